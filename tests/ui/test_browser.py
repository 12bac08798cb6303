"""The page in headless Chromium, while a scripted run goes on in another thread."""

from __future__ import annotations

import csv
import os
import re
import shutil
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect
from report.scripted import search_in
from report.test_html import NamesComponents

from openeureka.config import RunConfig
from openeureka.display import now
from openeureka.film.mp4 import encode
from openeureka.report import html
from openeureka.report.view import VIDEO, RunView
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply
from openeureka.types import Prompt, Reply, TrainingProgress, Usage
from openeureka.ui import actions, follow

from .conftest import PATIENCE, comes_true, served
from .serving import TOKEN

expect.set_options(timeout=PATIENCE)

ATTACK = "</pre><img src=x onerror='window.hacked=1; alert(1)'><script>window.hacked=1</script>\x1b[31m\u202e"


class Paced(ScriptedModel):
    """Gives a reply each time it is allowed one."""

    def __init__(self, script: Sequence[str]) -> None:
        super().__init__(script)
        self.allowed = threading.Semaphore(0)

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        for said in super().sample(prompt, n=n, seed=seed):
            self.allowed.acquire()
            yield said


@contextmanager
def running(directory: Path, script: Sequence[str], **settings: object) -> Iterator[Paced]:
    """A search that listens to a person, in a thread that ends soon after the context is left."""
    model = Paced(script)
    given = {"model": model, "iteration": 2, "feedback": "human", "feedback_timeout": 3 * PATIENCE / 1000}
    thread = threading.Thread(target=search_in, args=(directory, []), kwargs=given | settings)
    thread.start()
    try:
        yield model
    finally:
        model.allowed.release(len(script))
        thread.join()


def enter(page: Page) -> None:
    """Opens the run from the list, because its address is a 404 until the run has begun."""
    page.goto("/")
    page.get_by_role("link", name="run", exact=True).click()


def film(directory: Path, slot: int) -> None:
    """A second of grey as the video of a candidate of generation 0."""
    result = RunView.read(directory).candidates[slot].result
    assert result is not None
    made = directory / "grey.mp4"
    made.write_bytes(encode((np.full((48, 64, 3), 20 * shade, np.uint8) for shade in range(10)), rate=10))
    made.rename(directory / "lanes" / result.lane / VIDEO)


def test_a_person_follows_a_run_and_their_words_are_in_the_next_prompt(page: Page, tmp_path: Path):
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        enter(page)
        expect(page.locator(".hero .state")).to_have_text("running")
        assert page.locator("article").count() == 0

        model.allowed.release()
        expect(page.locator("#g0s0")).to_contain_text("drawn")  # it appeared without a reload
        model.allowed.release()
        expect(page.locator("#g0s1")).to_contain_text("trained F 7")
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()

        film(tmp_path / "run", slot=1)
        video = page.locator("#g0s1 video")
        expect(video).to_be_visible()
        video.evaluate("video => video.play()")
        assert comes_true(page, "document.querySelector('#g0s1 video').currentTime > 0")

        page.get_by_label("What should be different?").fill("Too jerky: <b>keep</b> the torso upright")
        page.get_by_role("button", name="Send", exact=True).click()
        expect(page.get_by_text("Too jerky: <b>keep</b> the torso upright")).to_be_visible()
        page.get_by_role("button", name="Send and continue").click()

        model.allowed.release(2)
        expect(page.locator("#g1s1")).to_contain_text("trained F 4")
        page.get_by_text("What the model was asked").first.click()
        expect(page.locator("details details pre", has_text="Too jerky: <b>keep</b> the torso upright")).to_be_visible()

        page.locator("#candidates").get_by_role("link", name="g1s0").click()
        expect(page.locator(".diff .removed")).to_have_text("-    return 8")
        expect(page.locator(".diff .added")).to_have_text("+    return 9")
    assert "Too jerky: <b>keep</b> the torso upright" in model.prompts[-1].messages[-1].content


def test_two_candidates_are_compared_and_the_better_one_gets_the_vote(page: Page, tmp_path: Path):
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        model.allowed.release(2)
        enter(page)
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()
        for name in ("g0s0", "g0s1"):
            page.get_by_label(f"compare {name}").check()
        page.get_by_role("button", name="Compare the selected ones side by side").click()
        expect(page.locator("section.candidate")).to_have_count(2)
        page.get_by_role("button", name="Better than g0s1").click()
        expect(page.get_by_text("g0s0 is better than g0s1")).to_be_visible()
        expect(page.locator("section.candidate")).to_have_count(2)  # for the next vote
        veto = page.get_by_role("button", name="Veto")
        expect(veto).to_have_count(0)  # folded away, so that nobody vetoes by accident
        page.get_by_text("Reject g0s1 for good").click()
        veto.click()
        expect(page.get_by_text("veto: g0s1")).to_be_visible()
        page.goto("/runs/run/")
        page.get_by_role("button", name="Send and continue").click()
        expect(page.get_by_text("Generation 1")).to_be_visible()


def test_what_a_person_types_opens_and_chooses_survives_the_news(page: Page, tmp_path: Path):
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        model.allowed.release()
        enter(page)
        page.get_by_label("What should be different?").fill("half a sen")
        page.get_by_text("What the model was asked").click()
        page.get_by_label("compare g0s0").check()
        model.allowed.release()
        expect(page.locator("#g0s0")).to_contain_text("trained F 6")  # its card was renewed
        expect(page.get_by_label("What should be different?")).to_have_value("half a sen")
        expect(page.locator("pre", has_text="Do the thing.")).to_be_visible()
        expect(page.get_by_label("compare g0s0")).to_be_checked()
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()
        page.get_by_role("button", name="Send and continue").click()


def test_a_link_that_is_pressed_while_news_comes_is_followed(page: Page, tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    page.goto("/")
    page.get_by_role("link", name="run", exact=True).first.hover()
    page.mouse.down()
    search_in(tmp_path / "other", [reply(7), reply(8)])
    assert comes_true(page, "waiting.length > 0")
    expect(page.get_by_role("link", name="other", exact=True)).to_be_hidden()
    page.mouse.up()
    expect(page).to_have_url(re.compile(r"/runs/run/$"))


def test_news_that_waited_for_a_press_is_shown_after_it(page: Page, tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    page.goto("/")
    page.get_by_role("heading").first.hover()
    page.mouse.down()
    search_in(tmp_path / "other", [reply(7), reply(8)])
    assert comes_true(page, "waiting.length > 0")
    page.mouse.up()
    expect(page.get_by_role("group", name="Runs").get_by_role("link", name="other", exact=True)).to_be_visible()


def test_nothing_that_others_wrote_runs(page: Page, tmp_path: Path):
    text = f"{ATTACK}\n```python\ndef compute_reward(x):\n    # {ATTACK}\n    return 7\n```"
    with running(
        tmp_path / "<img src=x onerror=alert(1)>", [text, ATTACK, reply(1), reply(2)], trainer=NamesComponents()
    ) as model:
        model.allowed.release(2)
        page.get_by_role("link", name="<img src=x onerror=alert(1)>").click()
        page.get_by_label("What should be different?").fill(ATTACK)
        expect(page.get_by_text("The run is waiting for your feedback.")).to_be_visible()
        page.get_by_role("button", name="Send", exact=True).click()
        expect(page.locator(".listens")).to_contain_text("<script>window.hacked=1</script>")  # loaded with the page
        page.get_by_role("button", name="Send and continue").click()
        model.allowed.release(2)
        expect(page.locator("#g1s1")).to_contain_text("trained F 1")  # sent to the open page
        page.locator("#candidates").get_by_role("link", name="g0s0").first.click()
        expect(page.get_by_text("Reward code")).to_be_visible()
        assert page.evaluate("window.hacked") is None
        assert page.locator("img").count() == 0 and page.locator("script").count() == 1


def test_a_page_that_has_lost_its_server_says_so_until_it_is_back(chromium: Browser, tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    with chromium.new_context() as context:
        page = context.new_page()
        with served(tmp_path) as port:
            page.goto(f"http://eureka:{TOKEN}@127.0.0.1:{port}/open")
            page.goto(f"http://127.0.0.1:{port}/runs/run/")
            expect(page.get_by_text("This page has lost its connection to eureka ui.")).to_be_hidden()
        expect(page.get_by_text("This page has lost its connection to eureka ui.")).to_be_visible()
        expect(page.locator("#lost")).to_have_css("position", "sticky")  # seen also far down the page
        with served(tmp_path, port):
            expect(page.get_by_text("This page has lost its connection to eureka ui.")).to_be_hidden()


def test_a_page_whose_connection_falls_silent_says_so_and_connects_anew(
    page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    lost = page.get_by_text("This page has lost its connection to eureka ui.")
    page.clock.install()
    monkeypatch.setattr(follow, "BEAT", 0.1)
    page.goto("/runs/run/")
    for _ in range(2):  # 40 s with heartbeats
        before = page.evaluate("timer")
        assert comes_true(page, f"timer !== {before}")
        page.clock.fast_forward(20_000)
        expect(lost).to_be_hidden()
    with monkeypatch.context() as patched:
        patched.setattr(follow, "BEAT", float("inf"))
        page.wait_for_timeout(1000)  # a heartbeat may be under way
        page.clock.fast_forward(30_000)
        expect(lost).to_be_visible()
    page.clock.fast_forward(2_000)
    expect(lost).to_be_hidden()
    assert comes_true(page, "source.readyState === EventSource.OPEN")


def test_lanes_are_followed_while_they_train(page: Page, tmp_path: Path):
    seen, release = threading.Event(), threading.Event()

    class Trains(ToyTrainer):
        """Stays half-way until `release`. First only one lane has an F; the others get theirs after `seen`."""

        def train(self, env, lanes, budget):
            for epoch in range(1, 6):
                if epoch == 5:
                    seen.wait()
                scores = {lane.id: float(epoch) if epoch == 5 or lane is lanes[0] else None for lane in lanes}
                yield TrainingProgress(epoch=epoch, epochs=9, env_steps_per_second=1234.0, fitness=scores)
            release.wait()
            yield from super().train(env, lanes, budget)

    directory, config = tmp_path / "run", RunConfig(env="toy", sample=2, iteration=1)
    recorder = now.Recorder(directory, config, Usage())
    settings = {"trainer": Trains(), "tell": recorder}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(now, "PAUSE", 0.0)
        thread = threading.Thread(target=search_in, args=(directory, [reply(7), reply(8)]), kwargs=settings)
        thread.start()
        try:
            enter(page)
            chart = page.locator(".chart", has_text="F of every lane as it trains")
            expect(chart.locator("canvas")).to_be_visible()
            expect(chart.locator(".plot")).not_to_have_attribute("aria-label", re.compile("g0s1"))
            seen.set()
            expect(page.get_by_text("Epoch 5 of 9, 1,234 steps/s")).to_be_visible()
            expect(chart.locator(".plot")).to_have_attribute("aria-label", re.compile("g0s1"))
            page.locator("#candidates").get_by_role("link", name="g0s0").click()
            expect(page.get_by_text("Training now")).to_be_visible()
        finally:
            seen.set()
            release.set()
            thread.join()
        expect(page.get_by_text("Training now")).to_be_hidden()


def test_a_chart_tells_what_is_under_the_pointer_zooms_hides_and_leads_on(page: Page, searched: Path):
    page.set_viewport_size({"width": 1280, "height": 1400})  # so tall that nothing scrolls
    page.goto("/runs/run/")
    chart = page.locator(".chart", has_text="F when played")
    plot = chart.locator(".u-over")
    box = plot.bounding_box()
    assert box is not None
    plot.hover(position={"x": 0.9 * box["width"], "y": box["height"] / 2})
    expect(chart.locator(".tip")).to_contain_text("g1s1")
    expect(chart.locator(".tip")).to_contain_text("candidate: 2\nbest so far: 7")
    chart.get_by_role("button", name="human reward").click()
    expect(chart.get_by_role("button", name="human reward")).to_have_attribute("aria-pressed", "false")
    plot.hover(position={"x": 0.91 * box["width"], "y": box["height"] / 2})
    expect(chart.locator(".tip")).not_to_contain_text("human reward")
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.95 * box["width"], box["y"] + 50)
    page.mouse.up()  # zoomed: g1s1, which was at 0.85 of the width, is now left of it
    plot.hover(position={"x": 0.7 * box["width"], "y": box["height"] / 2})
    expect(chart.locator(".tip")).to_contain_text("g1s1")
    plot.click(position={"x": 0.7 * box["width"], "y": 4})  # far from any point
    at = page.evaluate(
        "(() => { const { plot, chart } = eureka.of(document.querySelector('.chart'));"
        "return [plot.valToPos(3, 'x'), plot.valToPos(chart.lines[0].values[3], 'y')]; })()"
    )
    assert page.url.endswith("/runs/run/")
    plot.click(position={"x": at[0] + 3, "y": at[1] - 3})
    expect(page).to_have_url(re.compile(r"candidates\?show=g1s1$"))


def test_curves_are_smoothed_and_the_pointer_still_tells_what_was_measured(page: Page, searched: Path):
    page.goto("/runs/run/candidates?show=g0s0")
    chart = page.locator(".chart", has_text="F in training")
    plot, drawn = chart.locator(".u-over"), "canvas => canvas.toDataURL()"
    box = plot.bounding_box()
    assert box is not None
    plot.hover(position={"x": box["width"] - 5, "y": 5})
    told, before = chart.locator(".tip").inner_text(), chart.locator("canvas").evaluate(drawn)
    assert "this reward: 7" in told
    page.get_by_label("Smooth").first.fill("0.9")
    plot.hover(position={"x": box["width"] - 6, "y": 5})
    expect(chart.locator(".tip")).to_have_text(told)
    assert chart.locator("canvas").evaluate(drawn) != before
    page.reload()
    expect(page.get_by_label("Smooth").first).to_have_value("0.9")
    expect(page.locator(".smooth:visible")).to_have_count(1)  # one for two charts side by side
    page.goto("/runs/run/")
    expect(page.locator(".chart canvas")).to_be_visible()
    expect(page.get_by_label("Smooth")).to_have_count(0)  # that page has no chart over epochs


def test_candidates_are_sorted_filtered_and_found_by_their_family(page: Page, searched: Path):
    page.goto("/runs/run/")
    names = page.locator("#candidates tbody tr:visible td:nth-child(2)")
    expect(names).to_have_text(["g0s0", "g0s1", re.compile("g1s0"), "g1s1"])
    page.get_by_role("button", name="F played").click()
    expect(names).to_have_text([re.compile("g1s0"), "g0s0", "g1s1", "g0s1"])  # 7, 6, 2 and none
    page.get_by_role("button", name="F played").click()
    expect(names).to_have_text(["g1s1", "g0s0", re.compile("g1s0"), "g0s1"])
    page.locator(".tools").get_by_label("State").select_option("refused")
    expect(names).to_have_text(["g0s1"])
    page.locator(".tree").get_by_role("link", name="g1s1").click()
    expect(page.get_by_text("Made from generation 0, slot 0.")).to_be_visible()
    page.get_by_role("link", name="compare with its parent g0s0").click()
    expect(page.locator("section.candidate")).to_have_count(2)


def test_a_long_list_shows_its_first_rows_searches_all_and_shows_all_when_asked(page: Page, tmp_path: Path):
    first = search_in(tmp_path / "run-000", [reply(7), reply(8)])
    for number in range(1, 103):
        shutil.copytree(first, tmp_path / f"run-{number:03}")
        os.utime(tmp_path / f"run-{number:03}" / "run.sqlite", (number, number))
    page.goto("/")
    rows = page.locator("#runs tbody tr:visible")
    expect(rows).to_have_count(100)
    page.get_by_label("Find").fill("run-001")  # the oldest
    expect(rows).to_have_count(1)
    page.get_by_label("Find").fill("run")
    expect(rows).to_have_count(100)
    page.get_by_label("Show more than 100").check()
    expect(rows).to_have_count(103)


def test_runs_that_cannot_be_read_are_sorted_last_and_hide_no_news(page: Page, tmp_path: Path):
    for name in ("failed", "worse"):
        (tmp_path / name).mkdir()
    (tmp_path / "failed" / "run.log").write_text("There is no key.")
    search_in(tmp_path / "worse", [reply(3), reply(4)])
    search_in(tmp_path / "better", [reply(7), reply(8)])
    page.goto("/")
    names = page.locator("#runs tbody tr:visible td.called:nth-child(2)")
    for title, ordered in (("F held out", ["better", "worse", "failed"]), ("cost, US$", None), ("task", None)):
        page.get_by_role("button", name=title).click()
        expect(names.last).to_have_text("failed")
        if ordered:
            expect(names).to_have_text(ordered)
    page.get_by_role("button", name="F held out").click()
    page.get_by_label("Find").fill("e")
    search_in(tmp_path / "best", [reply(7), reply(12)])
    expect(names).to_have_text(["best", "better", "worse", "failed"])


def test_the_rows_that_are_shown_are_saved(page: Page, tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), "no code", reply(8), reply(3)], iteration=2)
    search_in(tmp_path / "=1+1", [reply(7), reply(8)])
    page.goto("/")
    with page.expect_download() as runs:
        page.get_by_role("button", name="Save as CSV").click()
    assert runs.value.suggested_filename == "runs.csv"
    rows = list(csv.reader(runs.value.path().read_text().splitlines()))
    assert rows[0][:3] == ["run", "state", "F held out"]
    assert sorted(row[0] for row in rows[1:]) == ["'=1+1", "run"]  # quoted: a spreadsheet would compute =1+1
    page.locator("#runs").get_by_role("link", name="run", exact=True).click()
    page.locator(".tools").get_by_label("State").select_option("trained")
    with page.expect_download() as candidates:
        page.get_by_role("button", name="Save as CSV").click()
    rows = list(csv.DictReader(candidates.value.path().read_text().splitlines()))
    assert [(row["candidate"], row["F played"], row["state"]) for row in rows] == [
        ("g0s0", "6.0", "trained"),
        ("g1s0", "7.0", "trained"),
        ("g1s1", "2.0", "trained"),
    ]


def test_runs_are_compared_by_what_they_found_and_how_they_differ(page: Page, tmp_path: Path):
    search_in(tmp_path / "one", [reply(7), reply(8)])
    search_in(tmp_path / "two", [reply(7), reply(12), reply(3), reply(4)], iteration=2)
    page.goto("/")
    expect(page.locator(".board tbody tr td:first-child")).to_have_text(["two", "one"])  # 11.01 and 7.01, held out
    for name in ("one", "two"):
        page.get_by_label(f"compare {name}").check()
    page.get_by_role("button", name="Compare the selected runs").click()
    expect(page.locator("#compared tbody tr")).to_have_count(2)
    expect(page.get_by_role("row", name="iteration 2 1")).to_be_visible()
    expect(page.locator(".chart canvas")).to_be_visible()


def test_the_report_works_by_itself_from_its_file(page: Page, searched: Path):
    file = searched / "report.html"
    file.write_text(html.report(RunView.read(searched), searched))
    page.goto(file.as_uri())
    chart = page.locator(".chart", has_text="F when played")
    chart.scroll_into_view_if_needed()
    expect(chart.locator("canvas")).to_be_visible()
    page.get_by_role("button", name="F played").click()
    expect(page.locator("#candidates tbody tr:first-child td:first-child")).to_contain_text("g1s0")
    code = page.locator("#g0s0").get_by_text("Reward code")
    expect(code).to_be_hidden()  # only the best candidate is unfolded
    expect(page.locator("#g1s0").get_by_text("Reward code")).to_be_visible()
    page.locator("#candidates").get_by_role("link", name="g0s0").first.click()
    expect(code).to_be_visible()
    widths = "() => [...document.querySelectorAll('.panel')].map((panel) => panel.clientWidth)"
    page.emulate_media(media="print")
    assert min(page.evaluate(widths)) > 600  # each as wide as the paper


def test_a_run_is_started_from_the_form(page: Page, monkeypatch: pytest.MonkeyPatch):
    # Only the form is tested here. A real run would take seconds to import torch.
    monkeypatch.setattr(actions, "_EUREKA", [sys.executable, "-c", "import sys; print(*sys.argv[1:])"])
    page.get_by_text("Start a run").click()
    page.get_by_label("task").fill("quadcopter")
    page.get_by_label("model", exact=True).fill("random")  # the embedded model may not be installed
    page.get_by_label("rewards per generation").fill("0")
    page.get_by_role("button", name="Start").click()
    assert page.url.endswith("/")  # the browser itself refuses 0
    page.get_by_label("rewards per generation").fill("3")
    page.get_by_role("button", name="Start").click()
    expect(page.locator("pre")).to_contain_text(
        "run env=quadcopter model=random sample=3 seed=0 device=cpu feedback=none"
    )
