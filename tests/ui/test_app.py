"""The pages without a browser: what they show, and that hostile content in them is only text."""

import asyncio
import contextlib
import json
import os
import re
import shutil
import socket
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlencode

import pytest
from filelock import FileLock
from report.scripted import search_in
from report.test_html import ELEMENTS, HOSTILE, NamesComponents, Page
from starlette.requests import Request

from openeureka.config import NO_MODEL, RunConfig
from openeureka.display import now
from openeureka.events import Began, nobody
from openeureka.method import given
from openeureka.method.lanes import Lanes
from openeureka.parsing import command_line
from openeureka.report.view import RunView
from openeureka.stats import mean
from openeureka.store import Store, read_config
from openeureka.store.db import FILENAME, LOCK, LOG
from openeureka.store.directory import is_asked_to_stop
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply
from openeureka.types import TrainingProgress, Usage
from openeureka.ui import actions, app

from .serving import awaited, visitor

MORE = {*ELEMENTS.split(), "link", "form", "textarea", "article", "datalist", "progress"}


def shown(client, path: str) -> Page:
    answer = client.get(path)
    assert answer.status_code == 200, answer.text
    return Page(answer.text)


def test_the_list_names_each_run_with_state_task_model_and_score(tmp_path):
    search_in(tmp_path / "first", [reply(1), reply(2)])
    page = shown(visitor(tmp_path), "/")
    assert "/runs/first/" in page.links()
    for cell in (
        "first",
        "finished",
        "toy",
        "local",
        "1 of 1",
        "1.01",
        "not decided",
        "0.0200",
    ):  # 0.0200: two replies of a cent each
        assert re.search(rf">{cell}</(td|a|span)>", page.source), cell


def test_the_list_has_the_human_score_beside_the_runs_own(tmp_path):
    search_in(tmp_path / "run", [reply(7), reply(8)], seeds=2)
    ended = RunView.read(tmp_path / "run").outcome
    assert ended is not None
    cells = re.findall(r'<td data-value="([^"]*)">', visitor(tmp_path).get("/").text)
    assert [float(cell) for cell in cells[:2]] == [mean(ended.method.held_out), mean(ended.human.held_out)]


def test_a_finished_run_says_what_f_is_what_to_type_and_shows_its_reward(tmp_path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    page = shown(visitor(tmp_path), "/runs/run/")
    assert "higher is better." in page.flat and f"eureka play {directory}" in page.flat
    assert page.flat.index("Best reward") < page.flat.index("def compute_reward") < page.flat.index("Candidates")
    (directory / "best" / "policy.safetensors").unlink()  # as where only the rest of the run was kept
    assert "eureka play" not in shown(visitor(tmp_path), "/runs/run/").flat


def test_a_comparison_begins_with_what_was_found(tmp_path):
    for name in ("one", "two"):
        search_in(tmp_path / name, [reply(7), reply(8)])
    page = shown(visitor(tmp_path), "/compare?run=one&run=two").source
    assert page.index('id="compared"') < page.index('class="chart"') < page.index("Settings that differ")
    assert page.count('<td class="why"><span>') == 2, "the style sheet shortens what is in the span"


def test_a_name_that_is_no_text_is_listed_as_far_as_it_is_one(tmp_path):
    search_in(tmp_path / os.fsdecode(b"\xe9t\xe9"), [reply(1), reply(2)])  # "été" in Latin-1, as on an old disk
    client = visitor(tmp_path)
    link = next(link for link in shown(client, "/").links() if link.startswith("/runs/"))
    assert "g0s1 trained F 1" in shown(client, link).flat


def test_a_run_can_be_stopped_while_it_is_at_work_and_continued_when_it_was_stopped(tmp_path):
    broken_off = ScriptedModel([reply(1)])
    with pytest.raises(IndexError):
        search_in(tmp_path / "run", model=broken_off, script=[])
    client = visitor(tmp_path)
    assert 'action="resume"' in shown(client, "/runs/run/").source
    with FileLock(tmp_path / "run" / LOCK):
        assert 'action="stop"' in shown(client, "/runs/run/").source
    search_in(tmp_path / "done", [reply(1), reply(2)])
    assert not {'action="stop"', 'action="resume"'} & set(
        re.findall(r'action="\w+"', shown(client, "/runs/done/").source)
    )


def test_the_log_is_unfolded_until_the_run_is_finished(tmp_path):
    for name, script in (("done", [reply(1), reply(2)]), ("stopped", [reply(1)])):
        with contextlib.suppress(IndexError):
            search_in(tmp_path / name, script)
        (tmp_path / name / LOG).write_text("how it went\n")
    client = visitor(tmp_path)
    pages = {name: shown(client, f"/runs/{name}/").source for name in ("done", "stopped")}
    assert "<details><summary>Latest output" in pages["done"]
    assert "<details open><summary>Latest output" in pages["stopped"]


def test_an_empty_folder_says_how_to_begin(tmp_path):
    assert "No run yet." in shown(visitor(tmp_path), "/").text


def test_a_folder_that_is_a_run_opens_it_and_starts_no_other(tmp_path):
    client = visitor(search_in(tmp_path / "run", [reply(1), reply(2)]))
    assert client.get("/").headers["location"] == "/runs/run/"
    assert "g0s1 trained F 1" in shown(client, "/runs/run/").flat
    assert "This page shows a single run" in client.post("/start", data={"env": "ant"}).text


def test_a_run_shows_a_card_for_each_candidate_and_the_prompts(tmp_path):
    search_in(tmp_path / "run", [reply(7), "nothing", reply(8), reply(9)], iteration=2)
    page = shown(visitor(tmp_path), "/runs/run/")
    text = " ".join(page.text.split())
    assert "g0s0 trained F 6" in text and "g0s1 refused" in text and "g1s1 trained F 8 best" in text
    assert "Do the thing." in text  # the prompt
    assert page.elements["article"] == 4


def test_a_run_is_headed_by_its_name_and_its_task(tmp_path):
    search_in(tmp_path / "my run", [reply(7), reply(8)])
    source = shown(visitor(tmp_path), "/runs/my%20run/").source
    assert "<h1>my run</h1>" in source and '<span class="task">toy</span>' in source
    assert source.count("1 of 1") == 1  # the tile
    assert source.index('class="wide panel verdict"') < source.index('class="tiles"')


def test_a_finished_run_shows_its_reward_what_f_is_and_what_to_type_next(tmp_path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    page = shown(visitor(tmp_path), "/runs/run/")
    assert "F is the task's own score; higher is better." in page.text
    assert page.text.index("Best reward") < page.text.index("return 8") and "so far" not in page.text
    assert command_line("play", str(directory)) in page.text
    with Store.open(directory, read_config(directory)):  # the run is at work
        assert "eureka play" not in shown(visitor(tmp_path), "/runs/run/").text


def test_each_member_of_the_family_says_its_f_and_the_keyboard_goes_by_the_table(tmp_path):
    search_in(tmp_path / "run", [reply(7), "nothing", reply(8), reply(9)], iteration=2)
    source = shown(visitor(tmp_path), "/runs/run/").source
    tree = source[source.index('<figure class="tree">') :]
    assert "<title>g1s1: F 8</title>" in tree and "<title>g0s1: no F</title>" in tree
    assert tree[: tree.index("</figure>")].count('tabindex="-1"') == 4


def test_what_cost_thousands_is_sorted_as_a_number(tmp_path):
    class Dear(ScriptedModel):
        def sample(self, prompt, *, n, seed):
            for said in super().sample(prompt, n=n, seed=seed):
                yield replace(said, usage=replace(said.usage, cost_usd=617.28))

    search_in(tmp_path / "run", [], model=Dear([reply(7), reply(8)]))
    for path in ("/", "/compare?run=run"):
        assert '<td data-value="1234.56">1,234.56</td>' in shown(visitor(tmp_path), path).source
    assert '<td data-value="617.28">617.28</td>' in shown(visitor(tmp_path), "/runs/run/").source


def test_candidates_stand_side_by_side_with_code_diff_replies_and_prompt(tmp_path):
    search_in(tmp_path / "run", [reply(7), reply(6), reply(8), reply(9)], iteration=2)
    page = shown(visitor(tmp_path), "/runs/run/candidates?show=g1s0&show=g0s1&show=g9s9&show=g1s0")
    assert page.source.count('<section class="candidate') == 2
    assert "Made from generation 0, slot 0." in page.text and "candidates?show=g0s0" in page.links()
    assert "-    return 7\n" in page.text and "+    return 8\n" in page.text
    assert "Here is the reward." in page.text and page.text.count("What the model was asked") == 2


def test_a_page_that_is_open_is_sent_what_is_new(tmp_path):
    """A page sends the marks of what it shows, and gets what has changed since."""

    class Watched(ScriptedModel):
        """Looks at the page between the two replies."""

        def sample(self, prompt, *, n, seed):
            for text in super().sample(prompt, n=n, seed=seed):
                yield text
                known = [mark for _, mark in sent[-1]["order"]] if sent else []
                sent.append(next_news(tmp_path, known))

    sent: list[dict] = []
    search_in(tmp_path / "run", model=Watched([reply(7), reply(8)]), script=[])
    first, second = (set(news["changed"].values()) for news in sent)
    assert any("g0s0" in html for html in first) and not any("g0s1" in html for html in first)
    assert any("g0s1" in html for html in second)
    assert not any('id="g0s0"' in html for html in second)  # its card had not changed


def next_news(root, known):
    """The first event that is sent to a page with these marks."""

    async def first():
        async for event in await opened(root, known):
            return json.loads(event.removeprefix("data: "))

    return awaited(first())


async def opened(root, known):
    """The events that are sent to a page with these marks."""
    scope = {"type": "http", "method": "GET", "path": "/runs/run/", "query_string": f"shown={','.join(known)}".encode()}
    scope |= {"headers": [(b"accept", b"text/event-stream")], "path_params": {"name": "run"}}

    async def receive():
        await asyncio.Event().wait()  # the page is never closed

    answer = await app.Pages(root, lambda: False).overview(Request(scope, receive))
    assert answer.media_type == "text/event-stream"
    return answer.body_iterator


def test_a_page_that_is_open_says_that_its_run_was_deleted(tmp_path, monkeypatch):
    monkeypatch.setattr("openeureka.ui.follow.PAUSE", 0.0)
    search_in(tmp_path / "run", [reply(7), reply(8)])

    async def listen():
        events = await opened(tmp_path, [])
        await anext(events)
        shutil.rmtree(tmp_path / "run")
        return json.loads((await anext(events)).removeprefix("data: "))

    for news in (awaited(listen()), next_news(tmp_path, [])):  # also when it connects again
        (said,) = news["changed"].values()
        assert "This run no longer exists." in said


def assert_inert(page: Page) -> None:
    assert set(page.elements) <= MORE
    assert page.elements["script"] == 1
    assert next(value for name, value in page.attributes if name == "src").startswith("/page.js?v=")
    assert not [name for name, _ in page.attributes if name.startswith("on") or name == "style"]
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u202a-\u202e\u2066-\u2069]", page.bare)
    assert not [link for link in page.links() if re.match(r"\w+:|//", link)]


def test_hostile_replies_programs_names_and_folders_are_text(tmp_path):
    text = f"{HOSTILE}\n```python\ndef compute_reward(x):\n    # {HOSTILE}\n    return 7\n```"
    name = HOSTILE.replace("/", "|")
    search_in(tmp_path / name, [text, f"{HOSTILE} no code"], trainer=NamesComponents())
    client = visitor(tmp_path)
    listed = shown(client, "/")
    assert_inert(listed)
    (address,) = {link for link in listed.links() if link.startswith("/runs/")}
    for path, times in ((address, 1), (f"{address}candidates?show=g0s0&show=g0s1", 4)):
        assert_inert(shown(client, path))
        assert shown(client, path).text.count("alert(1)") >= times


def test_a_megabyte_of_text_does_not_make_the_page_heavy(tmp_path):
    search_in(tmp_path / "run", ["x" * 1_000_000, "\x1b]" * 500_000])
    assert len(visitor(tmp_path).get("/runs/run/candidates?show=g0s0&show=g0s1").text) < 200_000


def test_videos_of_the_run_are_served_in_pieces_and_no_other_file(tmp_path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (directory / "best" / "video.mp4").write_bytes(b"0123456789")
    (tmp_path / "video.mp4").write_bytes(b"outside")
    client = visitor(tmp_path)
    answer = client.get("/runs/run/best/video.mp4", headers={"Range": "bytes=2-4"})
    assert (answer.status_code, answer.content, answer.headers["content-type"]) == (206, b"234", "video/mp4")
    for path in (
        *("best/policy.safetensors", "run.sqlite", "..%2fvideo.mp4"),
        *("%2e%2e/video.mp4", "best/%2e%2e/run.sqlite", "/etc/passwd", "best//video.mp4", "lanes/human-s0/video.mp4"),
    ):
        assert client.get(f"/runs/run/{path}").status_code == 404, path


@pytest.mark.parametrize("name", ["absent", "%2e%2e", "run%2f..", "%00"])
def test_a_run_that_is_not_in_the_folder_is_not_there(tmp_path, name):
    search_in(tmp_path / "outputs" / "run", [reply(7), reply(8)])
    search_in(tmp_path / "secret", [reply(7), reply(8)])
    assert visitor(tmp_path / "outputs").get(f"/runs/{name}/").status_code in (404, 405)


def test_runs_of_other_steps_are_on_other_boards(tmp_path):
    for name, steps in (("one", 2000), ("two", 2000), ("three", 1000)):
        search_in(tmp_path / name, [reply(7), reply(8)], steps=steps)
    boards = visitor(tmp_path).get("/").text.split("Leaderboards")[1].split('class="panel board"')[1:]
    assert [("2,000 steps" in board, board.count("<tr><td>")) for board in boards] == [(True, 2)], "it needs two runs"


def test_given_rewards_are_compared_with_the_scores_that_the_list_has(tmp_path):
    config = RunConfig(env="toy", model=NO_MODEL, seeds=2)
    with Store.open(tmp_path / "train", config) as store:
        given.keep(store, {"human": None, "sparse": None})
        given.train(Lanes(config, store, ToyTrainer(), nobody))
    for path in ("/", "/compare?run=train"):
        cells = re.findall(r"<td[^>]*>([^<]*)</td>", visitor(tmp_path).get(path).text)
        # ToyTrainer's F of the human reward is 10 + seed / 100, and one less when played: 9 and 9.01, on average 9.005.
        assert "9.005" in cells, path
        assert ("9.01" in cells) == path.startswith("/compare"), "the list shows no best F"


def test_runs_are_compared_whatever_they_are_called_and_those_too_many_are_counted(tmp_path, monkeypatch):
    for name in ("a\u200cb", "ab", "50%25"):
        search_in(tmp_path / name, [reply(7), reply(8)])
    client = visitor(tmp_path)
    boxes = re.findall(r'name="run" value="([^"]*)"', client.get("/").text)
    page = shown(client, "/compare?" + urlencode([("run", box) for box in boxes]))
    assert set(page.links()) >= {"/runs/a%E2%80%8Cb/", "/runs/ab/", "/runs/50%2525/"} and "not shown" not in page.text
    monkeypatch.setattr(app, "VIEWS", 1)
    page = shown(client, dict(page.attributes)["data-address"])  # the address that the page follows
    assert "2 more are not shown" in page.text and sum("/runs/" in link for link in page.links()) == 1


@pytest.mark.parametrize(
    ("path", "sentence"),
    [("/runs/absent/", "There is no such run."), ("/nothing", "There is no page at this address.")],
)
def test_an_address_that_leads_nowhere_shows_the_way_back(tmp_path, path, sentence):
    answer = visitor(tmp_path).get(path)
    assert answer.status_code == 404 and sentence in answer.text and '<a href="/">All runs</a>' in answer.text
    assert "script-src 'self'" in answer.headers["content-security-policy"]


def test_a_run_that_cannot_be_read_is_explained(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.log").write_text("\x1b[31mThere is no model <b>x</b>.")
    page = shown(visitor(tmp_path), "/runs/run/")
    assert "has not started" in page.text and "There is no model <b>x</b>." in page.text
    assert_inert(page)


def test_a_run_at_work_on_another_machine_is_followed_and_stopped(tmp_path):
    config = RunConfig(env="toy", sample=2, iteration=1)
    with Store.open(tmp_path / "run", config):
        (tmp_path / "run" / LOCK).write_text("73b1c2a0-0000-4000-8000-000000000000 node7\n")
        recorder = now.Recorder(tmp_path / "run", config, Usage())
        recorder(TrainingProgress(epoch=5, epochs=9, env_steps_per_second=1234.0, fitness={"a-s0": 3.0}))
        client = visitor(tmp_path)
        page = shown(client, "/runs/run/")
        assert "<h1>run</h1>" in page.source and "is running on node7" in page.text and "running" in page.text
        assert "Epoch 5 of 9, 1,234 steps/s" in page.text
        assert 'action="stop"' in page.source
        assert client.post("/runs/run/stop").status_code == 303
        assert is_asked_to_stop(tmp_path / "run")


def test_a_run_that_cannot_be_read_has_its_name_and_its_state_above_it(tmp_path):
    for name, file in (("failed", LOG), ("damaged", FILENAME)):
        (tmp_path / name).mkdir()
        (tmp_path / name / file).write_text("no database " * 100)
    for name, state in (("failed", "not begun"), ("damaged", "unreadable")):
        page = shown(visitor(tmp_path), f"/runs/{name}/")
        assert f"<h1>{name}</h1>" in page.source and f">{state}</span>" in page.source
        assert not {'action="stop"', 'action="resume"'} & set(re.findall(r'action="\w+"', page.source))


def test_a_choice_that_leads_to_nothing_says_so(tmp_path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    for name in ("failed", "broken"):
        (tmp_path / name).mkdir()
        (tmp_path / name / LOG).write_text("There is no key.")
    client = visitor(tmp_path)
    for rest in ("candidates", "candidates?show=g9s9"):
        assert "No candidate of this run is selected. Tick some" in shown(client, f"/runs/run/{rest}").flat
    page = shown(client, "/compare?run=failed&run=broken&run=run")
    assert "2 runs cannot be read: the list says why." in page.flat and "/runs/run/" in page.links()
    page = shown(client, "/compare?run=failed")
    assert "1 run cannot be read: the list says why." in page.flat and "No run is selected" not in page.flat


def test_a_run_is_shown_whose_log_cannot_be_opened(tmp_path, monkeypatch):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    monkeypatch.chdir(tmp_path / "run")
    with socket.socket(socket.AF_UNIX) as odd:
        odd.bind(LOG)
        assert "g0s1 trained F 7" in shown(visitor(tmp_path), "/runs/run/").flat
        Path(FILENAME).write_text("no database " * 100)
        assert "is damaged or not a run" in shown(visitor(tmp_path), "/runs/run/").text


def test_words_are_stored_and_shown_and_refused_ones_explained(tmp_path):
    def leave(event):
        if isinstance(event, Began) and event.phase == "feedback":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search_in(tmp_path / "run", [reply(7), reply(8)], tell=leave, iteration=2, feedback="human")
    client = visitor(tmp_path)
    for form in ({"words": f"too jerky {HOSTILE}"}, {"favourite": "g0s0"}, {"vote": "g0s1:g0s0"}):
        answer = client.post("/runs/run/remarks", data=form)
        assert (answer.status_code, answer.headers["location"]) == (303, "/runs/run/")
    page = shown(client, "/runs/run/")
    assert "too jerky" in page.text and "favourite: g0s0" in page.text and "g0s1 is better than g0s0" in page.text
    assert_inert(page)
    pair = "candidates?show=g0s0&show=g0s1"
    assert f'name="back" value="{pair.replace("&", "&amp;")}"' in shown(client, f"/runs/run/{pair}").source
    for back, place in ((pair, f"/runs/run/{pair}"), ("//elsewhere.org", "/runs/run/")):
        again = client.post("/runs/run/remarks", data={"favourite": "g0s0", "back": back})
        assert again.headers["location"] == place
    refused = client.post("/runs/run/remarks", data={"veto": "g7s7", "words": "too fast"})
    assert refused.status_code == 400 and "g7s7 is not a trained candidate" in refused.text
    assert ">too fast</textarea>" in refused.text
    with Store.view(tmp_path / "run") as store:
        assert [remark.kind for remark in store.remarks.unheard()][:3] == ["words", "favourite", "vote"]


def test_a_run_that_goes_on_by_itself_says_of_no_button_that_it_must_be_pressed(tmp_path):
    def leave(event):
        if isinstance(event, Began) and event.phase == "feedback":
            raise KeyboardInterrupt

    asked = {"iteration": 2, "feedback": "human", "feedback_timeout": 6.0}
    with pytest.raises(KeyboardInterrupt):
        search_in(tmp_path / "run", [reply(7), reply(8)], tell=leave, **asked)
    with Store.open(tmp_path / "run", read_config(tmp_path / "run")):
        page = shown(visitor(tmp_path), "/runs/run/").flat
    assert "The run is waiting for your feedback. “Send and continue” ends the wait." in page
    assert "continues after" not in page


def test_buttons_to_judge_stand_only_where_a_run_listens(tmp_path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    assert "Favourite" not in shown(visitor(tmp_path), "/runs/run/candidates?show=g0s0").text
    refused = visitor(tmp_path).post("/runs/run/remarks", data={"words": "hello"})
    assert refused.status_code == 400 and "does not wait for a person" in refused.text


def test_a_replay_repeats_what_was_said_and_listens_to_nobody(tmp_path):
    for name, model in (("asks", "local"), ("repeats", "replay:asks")):
        Store.open(tmp_path / name, RunConfig(env="toy", model=model, feedback="human", iteration=2)).close()
    assert actions.ear(tmp_path / "asks").listens and not actions.ear(tmp_path / "repeats").listens


def test_a_run_that_began_again_in_the_same_folder_shows_its_own_curves(tmp_path):
    class Steadier(ToyTrainer):
        """As good as ToyTrainer at its best, and better before that."""

        def result(self, lane):
            whole = super().result(lane)
            return replace(whole, curves={**whole.curves, "fitness": (6.25, whole.fitness, whole.fitness)})

    client = visitor(tmp_path)
    for trainer in (ToyTrainer(), Steadier()):
        search_in(tmp_path / "run", [reply(7), reply(8)], trainer=trainer)
        drawn = [value for name, value in shown(client, "/runs/run/candidates?show=g0s1").attributes if "chart" in name]
        assert any("6.25" in chart for chart in drawn) is isinstance(trainer, Steadier)
        shutil.rmtree(tmp_path / "run")
