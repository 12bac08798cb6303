"""The page is parsed as a browser would, and everything hostile in it must be text."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import pytest

from openeureka.refine.hardened import Robust, RobustArm
from openeureka.report import html
from openeureka.report.view import RunView
from openeureka.testing.scripted import ToyTrainer, reply
from openeureka.types import Generation, History

from .scripted import search_in
from .search import BASELINES, finished, refused, run

HOSTILE = (
    "</pre><script>alert(1)</script><img src=x onerror=alert(1)>\x1b[31mred\x1b]0;title\x07\u202egpj.\u200bexe&lt;"
)
ELEMENTS = """html head meta title style script body header nav main a span b small i p h1 h2 h3 h5 div section figure
figcaption table thead tbody tr th td dl dt dd ul li code pre details summary button label input select option svg rect
path circle line text polyline video"""


class Page(HTMLParser):
    """Elements, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.source = text
        self.elements: Counter[str] = Counter()
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.bare = re.sub(r"(<(style|script)[^>]*>).*?(</\2>)", r"\1\3", text, flags=re.DOTALL)
        """The page without the package's own styles and script."""
        self.feed(self.bare)
        self.flat = " ".join(self.text.split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements[tag] += 1
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text += data

    def links(self) -> list[str]:
        return [value for name, value in self.attributes if name in ("href", "src")]


class NamesComponents(ToyTrainer):
    """Trainings whose components and messages have hostile names."""

    def result(self, lane):
        result = super().result(lane)
        curves = {**result.curves, f"component/{HOSTILE}": (0.0, 1.0, 2.0)}
        return dataclasses.replace(result, curves=curves, message=HOSTILE)


def page(directory: Path) -> Page:
    return Page(html.report(RunView.read(directory), directory))


def assert_inert(shown: Page) -> None:
    assert set(shown.elements) <= set(ELEMENTS.split())
    assert shown.elements["script"] == 1
    assert not [name for name, _ in shown.attributes if name.startswith("on") or name == "style"]
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u202a-\u202e\u2066-\u2069]", shown.bare)
    assert all(link.startswith(("#", "lanes/", "best/", "data:video/mp4;base64,")) for link in shown.links())


def test_the_page_holds_every_candidate_with_its_code_diff_replies_and_prompts(tmp_path):
    replies = [reply(7), "```python\ndef compute_reward(x):\n    return x\n```", reply(8), reply(9)]
    shown = page(search_in(tmp_path / "run", replies, iteration=2))
    assert "Generation 0, slot 0 trained F 6" in shown.flat
    assert "Generation 0, slot 1 refused" in shown.flat
    assert "line 1: nothing is returned [no-number]; return a number" in shown.text
    assert "-    return 7\n" in shown.text and "+    return 8\n" in shown.text
    assert "Made from generation 0, slot 0." in shown.text
    assert "Here is the reward." in shown.text and "Do the thing." in shown.text
    assert "US$ 0.0100" in shown.text and "100 read, 10 written" in shown.text
    assert shown.source.count('<section class="candidate') == 4
    assert_inert(shown)


def test_every_link_within_the_page_has_its_place(tmp_path):
    shown = page(search_in(tmp_path / "run", [reply(n) for n in (7, 8, 9, 10)], iteration=2))
    places = {f"#{value}" for name, value in shown.attributes if name == "id"}
    assert set(shown.links()) <= places
    assert "#g0s1" in shown.links()


def test_hostile_replies_programs_names_and_messages_are_text(tmp_path):
    text = f"{HOSTILE}\n```python\ndef compute_reward(x):\n    # {HOSTILE}\n    return 7\n```"
    shown = page(search_in(tmp_path / "run", [text, f"{HOSTILE} no code"], trainer=NamesComponents()))
    assert_inert(shown)
    assert shown.text.count("<script>alert(1)</script>") >= 4  # reply, code, component, message
    charts = [value for name, value in shown.attributes if name == "data-chart"]
    assert any("<script>alert(1)</script>" in chart for chart in charts)
    assert "red" in shown.text and "gpj.exe&lt;" in shown.text


def test_hostile_findings_and_model_names_are_text(tmp_path):
    view = run(History((Generation(0, (refused(0, 0, HOSTILE),)),)), BASELINES)
    config = dataclasses.replace(view.config, model=HOSTILE, env=f"/x.py:{HOSTILE}")
    shown = Page(html.report(dataclasses.replace(view, config=config), tmp_path))
    assert_inert(shown)
    assert "<img src=x onerror=alert(1)>" in shown.text


def test_a_megabyte_of_text_is_cut_and_says_so(tmp_path):
    directory = search_in(tmp_path / "run", ["x" * 1_000_000, "\x1b]" * 500_000])
    shown = page(directory)
    assert len(shown.bare) < 200_000
    assert "[…] (970,000 more characters are in the files of the run)" in shown.text


def test_nothing_is_fetched_and_nothing_runs_but_the_script_of_the_page(tmp_path):
    shown = Page(html.report(finished(), tmp_path))
    (policy,) = [value for _, value in shown.attributes if value.startswith("default-src 'none'")]
    (script,) = re.findall(r"<script>(.*?)</script>", shown.source, re.DOTALL)
    own = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{own}';" in policy and "unsafe" not in policy
    assert not re.search(r"https?://", shown.bare)
    (style,) = re.findall(r"<style>(.*?)</style>", shown.source, re.DOTALL)
    assert "@import" not in style and set(re.findall(r"url\(.?(\w+:)", style)) == {"data:"}


def test_the_best_video_is_in_the_page_and_others_are_beside_it(tmp_path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    result = RunView.read(directory).candidates[0].result
    assert result is not None
    (directory / "best" / "video.mp4").write_bytes(b"mp4")
    (directory / "lanes" / result.lane / "video.mp4").write_bytes(b"mp4")
    assert page(directory).links()[1] == "data:video/mp4;base64,bXA0"
    assert "<video controls muted loop playsinline" in html.report(
        RunView.read(directory), directory
    )  # plays within the page
    assert f"lanes/{result.lane}/video.mp4" in page(directory).links()
    with (directory / "best" / "video.mp4").open("wb") as file:
        file.truncate(html.MAX_EMBEDDED + 1)
    assert "best/video.mp4" in page(directory).links()


def test_every_film_of_what_a_run_has_found_goes_with_the_page(tmp_path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    plain = RobustArm(name="plain", ranges=None, nominal=None, hard=None, worlds={}, chosen_by=None)
    (directory / "robust").mkdir()
    (directory / "robust" / "video.mp4").write_bytes(b"mp4")
    run = dataclasses.replace(RunView.read(directory), robust=Robust(arms=(plain,), ours="", before=(), after=()))
    assert "data:video/mp4;base64,bXA0" in Page(html.report(run, directory)).links()


def test_a_text_is_cut_at_its_limit():
    assert html.cut("a" * 400, 400) == "a" * 400
    assert html.cut("a" * 401, 400) == "a" * 400 + " […] (1 more characters are in the files of the run)"
    assert html.cut("a name", 3) == "a n…"


@pytest.mark.parametrize("name", ["{}", "{}+gain=2", "{}:Task"])
def test_a_report_imports_no_file_to_say_what_a_task_is_about(tmp_path, name):
    file = tmp_path / "theirs.py"
    file.write_text("raise SystemExit('imported')\n")
    assert html.intent(name.format(file)) == ""
    assert html.intent("cartpole+episode_length=9").startswith("to balance a pole")


@pytest.mark.parametrize(("model", "told"), [("random", False), ("gpt-5", True)])
def test_who_wrote_the_rewards_and_what_they_were_shown_is_true(model, told, tmp_path):
    shown = dataclasses.replace(run(History(())), config=dataclasses.replace(run(History(())).config, model=model))
    text = " ".join(Page(html.report(shown, tmp_path)).text.split())
    assert ("A language model (gpt-5) wrote reward functions" in text) is told
    assert ("the model was shown the best reward" in text) is told
    assert ("Without a language model, model=random drew random reward functions" in text) is not told
    assert ("a new random draw, which uses neither earlier results nor feedback" in text) is not told


def test_a_report_offers_what_the_run_has_files_for_and_says_which_folder_is_meant(tmp_path, monkeypatch):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    shown = page(directory).flat
    assert "Watch the best reward's policy: eureka play DIR" in shown and "DIR is the folder of this file." in shown
    monkeypatch.chdir(tmp_path)
    shown = page(directory).flat
    assert "eureka play run" in shown and "the folder of this file" not in shown
    (directory / "best" / "policy.safetensors").unlink()  # as in an archive, which keeps rows but no policies
    shown = page(directory).flat
    assert "eureka play" not in shown and "eureka train" not in shown


def test_the_rewards_to_compare_with_are_explained(tmp_path):
    assert "the sparse reward is F itself, paid step by step" in Page(html.report(finished(), tmp_path)).flat


def test_a_model_is_called_by_its_file_without_the_way_there():
    assert html.model("replay:runs/deep/over.json") == "replay:over.json"
    assert html.model("replay:outputs/ant") == "replay:ant" and html.model("openai/gpt-5") == "openai/gpt-5"


def test_a_long_name_may_go_on_in_the_next_line_and_stays_text():
    assert html.breakable("replay:a_<b>") == "replay:<wbr>a_<wbr>&lt;b&gt;"
