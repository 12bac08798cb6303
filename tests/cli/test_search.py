import json
import os
import signal
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from filelock import FileLock
from hostile_runs import edit
from toys import ToySandbox
from toys import eureka as run

import openeureka
from openeureka import __main__ as door
from openeureka.cli import remote
from openeureka.cli import train as commands
from openeureka.config import RunConfig
from openeureka.display import log, trackers
from openeureka.errors import ConfigError, EurekaError, ModelError
from openeureka.film import video
from openeureka.llm import open_model
from openeureka.report.view import VIDEO, RunView
from openeureka.runs import compose, stopping
from openeureka.sandbox import client, confine
from openeureka.store import Store, read_config, read_replies
from openeureka.store.db import LOCK, LOG, STOP
from openeureka.store.directory import ask_to_stop
from openeureka.tasks import registry
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, program, reply
from openeureka.types import Usage

SETTINGS = ["env=cartpole", "model=scripted", "sample=2", "iteration=2", "seeds=1", "video=none"]
TWO_SEEDS = [*(word for word in SETTINGS if word != "seeds=1"), "seeds=2"]
SCRIPT = [reply(3.0), reply(8.0), reply(12.0), reply(4.0)]


class Failing(ScriptedModel):
    """Fails after two replies."""

    def sample(self, prompt, *, n, seed):
        if self.said == 2:
            raise ModelError("The endpoint refused the key; check OPENAI_API_KEY.")
        yield from super().sample(prompt, n=n, seed=seed)


class Interrupting(ScriptedModel):
    """Ctrl-C after two replies."""

    def sample(self, prompt, *, n, seed):
        if self.said == 2:
            raise KeyboardInterrupt
        yield from super().sample(prompt, n=n, seed=seed)


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Replaces model, sandbox and trainer of a search by pure functions."""
    monkeypatch.setattr(compose, "open_model", lambda config, held: ScriptedModel(SCRIPT))
    monkeypatch.setattr(compose, "Sandbox", ToySandbox)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: ToyTrainer())
    return monkeypatch


def test_a_run_prints_its_best_reward_and_leaves_the_files_of_a_report(parts, tmp_path, capsys):
    assert run("run", *TWO_SEEDS, f"dir={tmp_path}/run") == 0
    text = capsys.readouterr().out
    assert "Generation 1: best F played 11, 2 of 2 trained" in text
    assert "return 12.0" in text
    made = {path.relative_to(tmp_path / "run").as_posix() for path in (tmp_path / "run").rglob("*")}
    assert {"report.html", "best/reward.py", "best/policy.safetensors", "messages.json"} <= made
    assert "lanes/human-s0/events.out.tfevents.0" in made
    # A toy's F held out is one less. The human reward's seed 0 counts too: (11.015 - 4) / (9.01 - 4).
    assert "<td>1.4</td>" in (tmp_path / "run" / "report.html").read_text()


def test_a_tracker_gets_the_films_that_the_report_made(parts, tmp_path):
    told: list[tuple[object, ...]] = []
    fake = SimpleNamespace(film=lambda *said: told.append(said), **dict.fromkeys(("numbers", "text"), lambda *_: None))
    fake.close = lambda: told.append(("closed",))
    parts.setitem(trackers.TRACKERS, "tensorboard", lambda directory, config: fake)

    def build(directory, *_):
        (film := directory / "lanes" / "human-s0" / VIDEO).write_bytes(b"")
        told.append(("made",))
        return [str(film)]

    parts.setattr(compose, "build", build)
    run("run", *SETTINGS, "log=tensorboard", f"dir={tmp_path}/run")
    assert [said[0] for said in told] == ["made", "films/human-s0", "closed"]


def test_a_failing_endpoint_is_one_sentence_and_the_way_to_continue(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Failing(SCRIPT))
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 3
    assert capsys.readouterr().err.splitlines() == [
        "The endpoint refused the key; check OPENAI_API_KEY.",
        f"What is done is kept. Continue with: eureka resume {tmp_path}/run",
    ]


def test_where_nothing_is_done_nothing_is_said_to_be_kept(parts, tmp_path, capsys):
    failing = Failing(SCRIPT)
    failing.said = 2  # so it fails at its first request
    parts.setattr(compose, "open_model", lambda config, held: failing)
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 3
    assert capsys.readouterr().err.splitlines() == [
        "The endpoint refused the key; check OPENAI_API_KEY.",
        f"Nothing is done yet. Try again with: eureka resume {tmp_path}/run",
    ]


def test_a_search_whose_model_is_not_installed_is_refused_before_anything_is_made(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("openeureka.llm.local.find_spec", lambda name: None)
    assert run("run", "env=cartpole", "model=local", f"dir={tmp_path}/run") == 3
    (sentence,) = capsys.readouterr().err.splitlines()
    assert "pip install 'openeureka[local]'" in sentence and not list(tmp_path.iterdir())


def test_ctrl_c_says_how_to_continue_and_resuming_asks_for_the_rest_only(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Interrupting(SCRIPT))
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 130
    assert f"eureka resume {tmp_path}/run" in capsys.readouterr().err

    rest = ScriptedModel(SCRIPT[2:])
    parts.setattr(compose, "open_model", lambda config, held: rest)
    assert run("resume", f"{tmp_path}/run", "max_cost=5") == 0
    assert rest.said == 2
    assert "best F played 11" in capsys.readouterr().out


def test_a_run_killed_at_its_first_rows_begins_with_the_same_command(parts, tmp_path, capsys):
    (tmp_path / "run").mkdir()
    for name in ("run.sqlite", LOCK):
        (tmp_path / "run" / name).touch()
    assert run("resume", f"{tmp_path}/run") == 5
    assert "start it again with the same `eureka run` command" in capsys.readouterr().err
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    assert "best F played 11" in capsys.readouterr().out


def test_a_replay_broken_off_goes_on_where_it_stopped(parts, tmp_path, capsys):
    run("run", *SETTINGS, f"dir={tmp_path}/first")
    again = [f"model=replay:{tmp_path}/first" if word.startswith("model=") else word for word in SETTINGS]
    parts.undo()
    for name, stand_in in (("Sandbox", ToySandbox), ("record_states", lambda env: {})):
        parts.setattr(compose, name, stand_in)
    trainings = iter([Interruption(), ToyTrainer()])
    parts.setattr("openeureka.executors.local.LocalExecutor", lambda **_: next(trainings))
    assert run("run", *again, f"dir={tmp_path}/second") == 130
    assert run("resume", f"{tmp_path}/second") == 0
    texts = [[reply.text for reply in read_replies(tmp_path / name)] for name in ("first", "second")]
    assert texts[0] == texts[1]


def test_a_run_that_has_all_its_replies_goes_on_without_a_key(parts, tmp_path, capsys):
    trainings = iter([Late(), ToyTrainer()])
    parts.setattr("openeureka.executors.local.LocalExecutor", lambda **_: next(trainings))
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 130
    parts.setattr(compose, "open_model", open_model)
    parts.delenv("OPENAI_API_KEY", raising=False)
    assert run("resume", f"{tmp_path}/run") == 0
    assert RunView.read(tmp_path / "run").config.model == "scripted"


class Late(ToyTrainer):
    """Ctrl-C in the third training, after those of two generations."""

    def __init__(self):
        super().__init__()
        self.calls = 0

    def train(self, env, lanes, budget):
        if self.calls == 2:
            raise KeyboardInterrupt
        self.calls += 1
        yield from super().train(env, lanes, budget)


class Interruption(ToyTrainer):
    """Ctrl-C in the first training."""

    def train(self, env, lanes, budget):
        raise KeyboardInterrupt
        yield


OWN = """
from openeureka.strategies import Best
from openeureka.testing.scripted import ToyTrainer

class Loud(Best):
    def __init__(self, config):
        super().__init__(config.sample)

    def ask(self, history, rng):
        print("asked for", self.samples)
        return Best.ask(self, history, rng)

class Elsewhere(ToyTrainer):
    def __init__(self, *, device, threads, snapshots):
        super().__init__()
        print("device", device, "threads", threads, snapshots.name)
"""


@pytest.fixture
def own(tmp_path, monkeypatch) -> None:
    """A module with a search and an executor, where Python finds it."""
    (tmp_path / "parts_of_mine.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)


def test_a_search_and_an_executor_of_ones_own_are_named_as_settings(parts, own, tmp_path, capsys):
    words = ["search=parts_of_mine:Loud", "executor=parts_of_mine:Elsewhere", "threads=1"]
    assert run("run", *SETTINGS, *words, f"dir={tmp_path}/run") == 0
    told = capsys.readouterr().out
    assert "device cpu threads 1 snapshots" in told and "asked for 2" in told
    assert run("show", f"{tmp_path}/run", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["ranked_by"] == "played"
    assert run("resume", f"{tmp_path}/run", "executor=local") == 0
    assert run("resume", f"{tmp_path}/run", "search=best") == 5


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("search=bst", "There is no search `bst`. Did you mean `best`?"),
        ("search=nowhere:Search", "`search=nowhere:Search` cannot be imported"),
        ("executor=lokal", "There is no executor `lokal`. Did you mean `local`?"),
        ("executor=nowhere:Executor", "`executor=nowhere:Executor` cannot be imported"),
    ],
)
def test_a_search_or_executor_that_is_none_is_refused_before_a_directory_is_made(parts, tmp_path, capsys, word, says):
    assert run("run", *SETTINGS, word, f"dir={tmp_path}/run") == 2
    assert capsys.readouterr().err.startswith(says)
    assert not (tmp_path / "run").exists()


def test_show_prints_every_slot_and_the_final_scores(parts, tmp_path, capsys):
    run("run", *TWO_SEEDS, f"dir={tmp_path}/run")
    capsys.readouterr()
    assert run("show", f"{tmp_path}/run") == 0
    lines = capsys.readouterr().out.splitlines()
    slots = [line.split() for line in lines if line[:1].isdigit()]
    assert [(slot[0], slot[1], slot[4], slot[7], slot[8]) for slot in slots] == [
        ("0", "0", "2", "3", "accepted"),
        ("0", "1", "7", "8", "accepted"),
        ("1", "0", "11", "12", "accepted"),
        ("1", "1", "3", "4", "accepted"),
    ]
    assert any(line.startswith("Human-normalised score, held out: 1.4") for line in lines)
    assert lines[0].split()[-1] == "checked" and "Best reward, g1s0:" in lines


def test_show_says_how_a_run_that_stopped_goes_on(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Failing(SCRIPT))
    run("run", *SETTINGS, f"dir={tmp_path}/run")
    capsys.readouterr()
    assert run("show", f"{tmp_path}/run") == 0
    way = f"This run has stopped. {tmp_path}/run/run.log shows what it did last. To continue: eureka resume {tmp_path}"
    assert f"\n{way}/run\n" in capsys.readouterr().out
    with Store.open(tmp_path / "begun", RunConfig(iteration=3)):
        assert run("show", f"{tmp_path}/begun") == 0
        assert "has stopped" not in capsys.readouterr().out
    assert run("show", f"{tmp_path}/begun") == 0
    shown = capsys.readouterr().out
    assert shown.startswith("No generation is trained yet.\n") and "0 of 3 generations are done." in shown
    assert f"\nThis run has stopped. To continue: eureka resume {tmp_path}/begun\n" in shown


def test_a_run_is_json_for_programs(parts, tmp_path, capsys):
    run("run", *TWO_SEEDS, f"dir={tmp_path}/run")
    capsys.readouterr()
    assert run("show", f"{tmp_path}/run", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["settings"]["env"], found["settings"]["sample"], found["ranked_by"]) == ("cartpole", 2, "played")
    slots = [slot for generation in found["generations"] for slot in generation["slots"]]
    told = [(s["name"], s["played_fitness"], s["played_error"], s["fitness"], s["verdict"], s["state"]) for s in slots]
    assert told == [
        ("g0s0", 2.0, 0.0, 3.0, "accepted", "trained"),
        ("g0s1", 7.0, 0.0, 8.0, "accepted", "trained"),
        ("g1s0", 11.0, 0.0, 12.0, "accepted", "trained"),
        ("g1s1", 3.0, 0.0, 4.0, "accepted", "trained"),
    ]
    assert found["best"]["name"] == "g1s0" and "return 12.0" in found["best"]["source"]
    # A toy's F held out is one less, and each seed adds seed / 100. The human reward's seed of the search counts too.
    final = found["final"]["rewards"]
    assert final["best"]["fitness"][0] - 1 == pytest.approx(final["best"]["held_out_fitness"][0])
    assert final["human"]["held_out_fitness"] == pytest.approx([9.0, 9.01, 9.02])
    assert found["verdict"].startswith("The generated reward is better than the human one: F 11.02 (2 seeds)")
    assert found["score"] == pytest.approx(1.4, abs=0.01)


def test_a_run_under_way_is_json_too(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Failing(SCRIPT))
    run("run", *SETTINGS, f"dir={tmp_path}/run")
    capsys.readouterr()
    assert run("show", f"{tmp_path}/run", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert [generation["finished"] for generation in found["generations"]] == [True, False]
    assert (found["final"], found["score"]) == (None, None)
    assert found["verdict"] == "Not decided yet: the final trainings are not done."


def test_a_given_reward_that_is_refused_leaves_no_directory(parts, tmp_path, capsys):
    (tmp_path / "mine.py").write_text("def compute_reward(x):\n    return x\n")
    assert run("run", *SETTINGS, f"init={tmp_path}/mine.py", f"dir={tmp_path}/run") == 2
    assert "was refused: line 1: nothing is returned" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_given_reward_may_be_a_chat_reply_and_is_found_from_any_directory(parts, tmp_path, capsys, monkeypatch):
    (tmp_path / "chat.txt").write_text(f"Sure! Here it is.\n\n{reply(9.0)}\nIt is smooth.\n")
    monkeypatch.chdir(tmp_path)
    assert run("run", *SETTINGS, "init=chat.txt", f"dir={tmp_path}/run") == 0
    (given,) = RunView.read(tmp_path / "run").generations[0].candidates
    assert given.program is not None and given.program.source == program(9.0)
    assert read_config(tmp_path / "run").init == f"{tmp_path}/chat.txt"


def test_a_run_goes_on_without_the_given_file(parts, tmp_path, capsys):
    (tmp_path / "mine.py").write_text(program(9.0))
    parts.setattr(compose, "open_model", lambda config, held: Interrupting(SCRIPT))
    assert run("run", *SETTINGS, f"init={tmp_path}/mine.py", f"dir={tmp_path}/run") == 130
    (tmp_path / "mine.py").unlink()
    parts.setattr(compose, "open_model", lambda config, held: ScriptedModel(SCRIPT[2:]))
    capsys.readouterr()
    assert run("resume", f"{tmp_path}/run") == 0, capsys.readouterr().err
    assert "is finished" not in capsys.readouterr().out


def test_a_finished_run_says_so_when_it_is_resumed_and_how_to_improve_what_it_found(parts, tmp_path, capsys):
    own = "steps=1e5", "safety=gentle joints", "max_cost=3"
    assert run("run", *SETTINGS, *own, f"dir={tmp_path}/run") == 0
    capsys.readouterr()
    assert run("resume", f"{tmp_path}/run") == 0
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{tmp_path}/run is finished; its result is below.")
    assert second == (
        f"  eureka run env=cartpole init={tmp_path}/run/best/reward.py seed=2 model=scripted sample=2 iteration=2 "
        "'safety=gentle joints' seeds=1 steps=100000 max_cost=3.0 video=none"
    )


def test_a_run_is_refused_other_settings_before_anything_is_said_of_it(parts, tmp_path, capsys):
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    capsys.readouterr()
    assert run("resume", f"{tmp_path}/run", "sample=7") == 5
    told = capsys.readouterr()
    assert told.out == "" and "other settings: sample=7 (was 2). Leave them out" in told.err


@pytest.mark.parametrize("name", ["show", "report", "resume"])
def test_a_directory_that_is_no_run_is_said(name, tmp_path, capsys):
    assert run(name, str(tmp_path)) == 5
    assert "is not a run" in capsys.readouterr().err


def test_video_all_films_every_lane_of_the_search_and_the_report_shows_them(parts, tmp_path, capsys):
    parts.setattr(video, "render", lambda *_, **__: b"mp4")
    settings = [word for word in SETTINGS if not word.startswith("video=")]
    assert run("run", *settings, "video=all", f"dir={tmp_path}/run") == 0
    assert len(list((tmp_path / "run").glob("lanes/*-s0/video.mp4"))) == 4 + 2  # four candidates, human, sparse
    assert (tmp_path / "run" / "report.html").read_text().count('src="lanes/') == 4 + 2


def test_a_report_made_later_may_ask_for_all_videos(parts, tmp_path, capsys):
    parts.setattr(video, "render", lambda *_, **__: b"mp4")
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    assert not list((tmp_path / "run").glob("lanes/*/video.mp4"))
    assert run("report", f"{tmp_path}/run", "video=all") == 0
    assert len(list((tmp_path / "run").glob("lanes/*/video.mp4"))) == 4 + 2
    assert f"Wrote {tmp_path}/run/report.html" in capsys.readouterr().out
    assert run("report", f"{tmp_path}/run", "video=some") == 2


def test_a_run_refuses_a_kernel_that_cannot_confine_before_the_model_is_asked(parts, tmp_path, capsys):
    model = ScriptedModel(SCRIPT)
    parts.setattr(compose, "open_model", lambda config, held: model)
    parts.setattr(compose, "Sandbox", client.Sandbox)
    parts.setattr(compose, "record_states", search_states)
    parts.setattr(confine, "support", lambda: confine.Support("x86_64", 0, True))
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 6
    said = capsys.readouterr()
    text = said.out + said.err
    assert "no Landlock" in text and "add unsafe_no_sandbox=true" in text
    assert model.prompts == [] and not (tmp_path / "run").exists()


def test_the_flag_must_be_typed_to_run_without_confinement(parts, tmp_path):
    asked: list[bool] = []

    class Noted(ToySandbox):
        def __enter__(self) -> ToySandbox:
            asked.append(self.unsafe)
            return self

    parts.setattr(compose, "Sandbox", Noted)
    assert run("run", *SETTINGS, f"dir={tmp_path}/a") == 0
    assert run("run", *SETTINGS, f"dir={tmp_path}/b", "unsafe_no_sandbox=true") == 0
    assert asked == [False, True]


def search_states(env: str) -> dict[str, object]:
    """Values for every variable of a task, without its physics."""
    return {variable.name: torch.zeros(4, *variable.shape) for variable in registry.get(env).spec.variables}


def test_a_run_tells_its_log_how_it_goes_and_why_it_ended(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Failing(SCRIPT))
    run("run", *SETTINGS, f"dir={tmp_path}/run")
    parts.setattr(compose, "open_model", lambda config, held: Interrupting(SCRIPT[2:]))
    run("resume", f"{tmp_path}/run")
    log = (tmp_path / "run" / LOG).read_text()
    told = ["Generation 0: best F 7, 2 of 2 trained", "The endpoint refused the key", "Generation 1: best F 11"]
    assert [log.find(line) for line in told] == sorted(log.index(line) for line in told)
    assert "\x1b" not in log and log.count("Generation 0") == 2  # the second process read it from the store


@pytest.mark.parametrize(("printed", "observers"), [(LOG, 1), ("elsewhere", 2)])
def test_what_is_printed_into_the_log_is_not_written_there_twice(tmp_path, printed, observers):
    stdout = os.dup(1)
    try:
        with (tmp_path / printed).open("wb") as file:
            os.dup2(file.fileno(), 1)
        with log.logged(tmp_path, RunConfig(env="cartpole"), Usage()) as found:
            assert len(found) == observers  # one writes the file that the page follows
    finally:
        os.dup2(stdout, 1)
        os.close(stdout)


def test_a_search_does_not_stop_for_a_log_that_cannot_be_written(parts, tmp_path, capsys):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOG).symlink_to("/dev/full")
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0


def test_a_run_that_is_asked_to_stop_stops_as_by_ctrl_c_and_forgets_the_request(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Asking(SCRIPT, tmp_path / "run"))
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 130
    assert f"eureka resume {tmp_path}/run" in capsys.readouterr().err
    assert (tmp_path / "run" / LOG).read_text().endswith("Stopped\n")
    (tmp_path / "run" / STOP).touch()  # asked again a moment too late
    parts.setattr(compose, "open_model", lambda config, held: ScriptedModel(SCRIPT[2:]))
    assert run("resume", f"{tmp_path}/run") == 0


class Asking(ScriptedModel):
    """After two replies, asks its run to stop, as another process would, and waits."""

    def __init__(self, script, directory):
        super().__init__(script)
        self._directory = directory

    def sample(self, prompt, *, n, seed):
        if self.said == 2:
            ask_to_stop(self._directory)
            time.sleep(900)
        yield from super().sample(prompt, n=n, seed=seed)


class Terminating(ScriptedModel):
    """SIGTERM after two replies."""

    def sample(self, prompt, *, n, seed):
        if self.said == 2:
            signal.raise_signal(signal.SIGTERM)
        yield from super().sample(prompt, n=n, seed=seed)


def test_a_run_that_is_terminated_stops_as_by_ctrl_c(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Terminating(SCRIPT))
    parts.setattr("sys.argv", ["eureka", "run", *SETTINGS, f"dir={tmp_path}/run"])
    before = signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(SystemExit) as ended:
            door.main()
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL  # a second one ends it at once
    finally:
        signal.signal(signal.SIGTERM, before)
    told = capsys.readouterr()
    assert ended.value.code == 130 and "Stopping: trainings are being saved" in told.out
    assert told.err == f"Stopped, nothing is lost. Continue with: eureka resume {tmp_path}/run\n"


def test_stop_waits_until_nobody_works_on_the_run(parts, tmp_path, capsys, monkeypatch):
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    assert run("stop", f"{tmp_path}/run") == 5
    assert "so there is nothing to stop" in capsys.readouterr().err
    assert run("stop", f"{tmp_path}/elsewhere") == 5
    assert "is not a run" in capsys.readouterr().err

    monkeypatch.setattr(remote, "PATIENCE", 0.2)
    with FileLock(tmp_path / "run" / LOCK, thread_local=False) as held:
        assert run("stop", f"{tmp_path}/run") == 5
        assert "was asked to stop but still runs" in capsys.readouterr().err
        monkeypatch.setattr(remote, "PATIENCE", 900.0)
        threading.Timer(0.5, held.release).start()
        assert run("stop", f"{tmp_path}/run") == 0
    # The search has finished, so the command that is stopped is a later one, such as `eureka robust`.
    assert capsys.readouterr().out == "Stopped, nothing is lost. Continue the way you started it.\n"


def interrupt(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_ctrl_c_before_a_search_has_begun_leaves_nothing(parts, tmp_path, capsys):
    parts.setattr(compose, "record_states", interrupt)
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 130
    assert capsys.readouterr().err == "Stopped before it began.\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["run", "train", "tune"])
def test_a_directory_that_can_hold_no_run_is_refused_before_anything_is_told(command, parts, tmp_path, capsys):
    (tmp_path / "hop.xml").touch()
    parts.chdir(tmp_path)
    words = SETTINGS if command == "run" else ["env=cartpole", "reward=human"]
    parts.setattr("openeureka.cli.train.to_tune", lambda *_: None)
    for name, why in (
        ("hop.xml", "hop.xml is a file, but a run is a directory; choose another dir=."),
        ("hop.xml/run", "hop.xml is a file, but a run is a directory; choose another dir=."),
        (".", ". is not empty and not a run; choose another dir=."),
    ):
        assert run(command, *words, f"dir={name}") == 5
        assert tuple(capsys.readouterr()) == ("", f"{why}\n")


@pytest.mark.parametrize("command", ["run", "resume"])
def test_a_run_at_work_is_refused_to_a_second_command_before_that_tells_anything(command, parts, tmp_path, capsys):
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    capsys.readouterr()
    with FileLock(tmp_path / "run" / LOCK):
        assert (
            run(*(["resume", f"{tmp_path}/run"] if command == "resume" else ["run", *SETTINGS, f"dir={tmp_path}/run"]))
            == 5
        )
    told = capsys.readouterr()
    assert told.err == (
        f"Another process is working on {tmp_path}/run; wait for it, or stop it with: eureka stop {tmp_path}/run\n"
    )
    assert "generations of" not in told.out


@pytest.mark.parametrize("command", ["resume", "report"])
def test_a_run_that_may_not_be_written_is_refused_before_anything_is_told(command, parts, tmp_path, capsys):
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    capsys.readouterr()
    parts.setattr(os, "access", lambda path, mode: not mode & os.W_OK)
    assert run(command, f"{tmp_path}/run") == 5
    sentence = f"{tmp_path}/run cannot be written; check its permissions, work on a copy or choose another folder.\n"
    assert tuple(capsys.readouterr()) == ("", sentence)


def test_a_finished_run_gives_no_advice_where_a_device_is_missing(parts, tmp_path, capsys):
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    capsys.readouterr()
    parts.setattr(compose, "trainer_of", lambda *_: refuse())
    assert run("resume", f"{tmp_path}/run", "device=cuda") == 2
    assert tuple(capsys.readouterr()) == ("", "There is no GPU.\n")


@pytest.mark.parametrize("command", ["train", "tune"])
def test_a_device_that_is_missing_is_said_before_the_task_is_tried(command, parts, tmp_path, capsys):
    parts.setattr("openeureka.cli.train.to_tune", lambda *_: None)
    parts.setattr("openeureka.cli.train.left_out", lambda *_: "It trained with other settings.")
    parts.setattr(compose, "trainer_of", lambda *_: refuse())
    assert run(command, "env=cartpole", "reward=human", f"dir={tmp_path}/run") == 2
    assert tuple(capsys.readouterr()) == ("", "There is no GPU.\n")


@pytest.mark.parametrize("command", ["train", "tune"])
@pytest.mark.parametrize("from_python", [False, True])
@pytest.mark.parametrize("setting", ["device=gpu", "executor=cloud", "randomise=soft", "curriculum=soft", "dir=file"])
def test_a_wrong_setting_is_said_before_a_reward_is_judged(command, from_python, setting, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("openeureka.runs.rewards.judge", lambda *_, **__: pytest.fail("judged"))
    Path("file").write_text("")
    Path("mine.py").write_text(program(12.0))
    key, _, value = setting.partition("=")
    with pytest.raises(EurekaError, match=value):
        if from_python:
            getattr(openeureka, command)("cartpole", "mine.py", **{key: value})
        else:
            getattr(commands, command)(["reward=mine.py", setting])
    assert not Path("outputs").exists()


def refuse():
    raise ConfigError("There is no GPU.")


def test_a_damaged_run_is_refused_before_its_report_is_announced(parts, tmp_path, capsys):
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 0
    capsys.readouterr()
    edit(tmp_path / "run", "DELETE FROM entries WHERE generation = 0")
    assert run("report", f"{tmp_path}/run") == 5
    told = capsys.readouterr()
    assert told.out == "" and "a generation is missing" in told.err


def test_ctrl_c_while_a_run_is_taken_up_says_how_to_continue(parts, tmp_path, capsys):
    parts.setattr(compose, "open_model", lambda config, held: Interrupting(SCRIPT))
    run("run", *SETTINGS, f"dir={tmp_path}/run")
    capsys.readouterr()
    parts.setattr(compose, "record_states", interrupt)
    assert run("resume", f"{tmp_path}/run") == 130
    assert f"eureka resume {tmp_path}/run" in capsys.readouterr().err


def test_ctrl_c_in_the_report_says_how_to_write_it(parts, tmp_path, capsys):
    parts.setattr(compose, "build", interrupt)
    assert run("run", *SETTINGS, f"dir={tmp_path}/run") == 130
    sentence = f"Stopped; the search is done. Write its report with: eureka report {tmp_path}/run\n"
    assert capsys.readouterr().err == sentence
    assert run("report", f"{tmp_path}/run") == 0
    assert (tmp_path / "run" / "report.html").is_file()


def test_ctrl_c_is_answered_at_once_and_the_second_one_does_not_wait(capsys):
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), stopping.announced():
        signal.raise_signal(signal.SIGINT)
    assert capsys.readouterr().out.startswith("Stopping: trainings are being saved")
    with pytest.raises(KeyboardInterrupt), stopping.announced():
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            capsys.readouterr()
            signal.raise_signal(signal.SIGINT)
    assert capsys.readouterr().out == ""
    assert signal.getsignal(signal.SIGINT) is before


def test_a_shell_that_has_ctrl_c_ignored_is_obeyed():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stopping.announced():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
