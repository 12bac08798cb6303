"""`eureka tune` from the command line to the page, with a trainer that knows which numbers are best."""

import io
import json
import math
import re
import shlex
import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import NamedTuple

import pytest

import openeureka
from openeureka.cli.facts import facts
from openeureka.cli.main import main
from openeureka.cli.show import show
from openeureka.cli.train import resume, train, tune
from openeureka.config import RunConfig, TuneConfig
from openeureka.errors import ConfigError, Interrupted, RewardFileError, StoreError, TaskError, WorkerError
from openeureka.report.view import RunView
from openeureka.runs.rewards import left_out, to_tune
from openeureka.sandbox.client import Sandbox
from openeureka.stats import mean
from openeureka.store import Store
from openeureka.tasks import human
from openeureka.tasks.registry import get
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import Node, RewardGraph, TrainingResult, TrainingState
from openeureka.ui import folder, pages

MINE = """import torch

WIDTH = 8.0


def compute_reward(pole_angle, cart_position):
    upright = torch.exp(-WIDTH * pole_angle**2)
    centred = 0.25 * torch.exp(-cart_position.abs())
    return upright + centred, {"upright": upright, "centred": centred}
"""


class Knowing(ToyTrainer):
    """F is 50 minus the sum of the squared logarithms of all numbers in the graph, so each should be 1."""

    def result(self, lane):
        assert isinstance(lane.program, RewardGraph)
        numbers = [arg for node in lane.program.nodes for arg in node.args if isinstance(arg, float) and arg]
        worth = 50.0 - sum(math.log(abs(number)) ** 2 for number in numbers)
        graph = RewardGraph(nodes=(Node("full", (worth,)),), reward=0, components=())
        return super().result(openeureka.types.LaneSpec(id=lane.id, program=graph, seed=lane.seed))


@pytest.fixture
def toy(one_sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> Knowing:
    trainer = Knowing()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: trainer)
    return trainer


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    return path


def words(mine, tmp_path, *more):
    return ["env=cartpole", f"reward={mine}", "trials=12", "sample=6", "seeds=2", f"dir={tmp_path}/out", *more]


class Tuned(NamedTuple):
    """A finished tuning: its run directory and what it printed."""

    directory: Path
    said: str


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Tuned:
    folder, said = tmp_path_factory.mktemp("tuned"), io.StringIO()
    (folder / "mine.py").write_text(MINE)
    with pytest.MonkeyPatch.context() as patched, redirect_stdout(said):
        patched.setattr("openeureka.executors.local.LocalExecutor", lambda **_: Knowing())
        tune(words(folder / "mine.py", folder))
    return Tuned(folder / "out", said.getvalue())


@pytest.fixture
def tuned(once: Tuned, tmp_path: Path) -> Tuned:
    """A copy of the finished tuning for each test."""
    return once._replace(directory=shutil.copytree(once.directory, tmp_path / "out"))


def test_what_it_leaves_open_the_last_line_decides(toy, mine, tmp_path, capsys):
    tune([word for word in words(mine, tmp_path, "seeds=1") if word != "seeds=2"])
    said = capsys.readouterr().out
    assert "One seed says nothing about the next" in said
    command = shlex.split(said.splitlines()[-1].removeprefix("To decide what is open: "))
    assert command[:2] == ["eureka", "train"] and command[-2:] == ["seed=2", "seeds=3"]
    train([*command[2:], f"dir={tmp_path}/decided"])
    decided = RunView.read(tmp_path / "decided")
    before, after = decided.given
    glance, tuned = folder.entry("out", tmp_path / "out").glance, RunView.read(tmp_path / "out").tuned
    assert glance is not None and glance.held_out == mean(tuned.finals[tuned.after].held_out)
    assert decided.texts[before].source == MINE != decided.texts[after].source
    assert f"{after} is better than {before}" in capsys.readouterr().out
    assert unescape(
        re.findall(r"<li>[^<]*<code>(.*?)</code>", (tmp_path / "out" / "report.html").read_text())[0]
    ).startswith("eureka train env=cartpole reward=DIR/candidates/")


def test_it_prints_numbers_before_and_after_and_leaves_a_run(tuned):
    assert "cartpole: 12 trainings fit the numbers of a reward" in tuned.said
    assert "WIDTH" in tuned.said and "centred 0.25" in tuned.said
    assert "over 12 trainings" in tuned.said
    assert "The tuned numbers are better than the original ones: F " in tuned.said
    run = RunView.read(tuned.directory)
    assert run.tunes and not run.searched
    found = run.tuned
    width, centred = found.effects
    assert (width.weight.value, centred.weight.value) == (8.0, 0.25)
    assert 0.0 < width.after < 8.0
    best = (tuned.directory / "best" / "reward.py").read_text()
    assert best == MINE.replace("8.0", repr(width.after)).replace("0.25", repr(centred.after))
    assert {lane.role for lane in run.lanes.values()} == {"tuned", "final"}
    assert folder.entry("", tuned.directory).state is folder.RunState.FINISHED


def test_the_report_the_page_and_show_say_the_same(tuned, capsys):
    sentence = "The tuned numbers are better than the original ones"
    show(tuned.directory)
    said = capsys.readouterr().out
    assert sentence in said and "centred 0.25" in said
    report = (tuned.directory / "report.html").read_text()
    run = RunView.read(tuned.directory)
    page = str(pages.overview(tuned.directory, run) | pages.now(tuned.directory, run))
    for text in (report, page):
        assert sentence in text and "centred 0.25" in text and "F with a larger change" in text
    assert "trial_11" in report and "The reward after" in report
    assert "The numbers in a reward are fitted" in page


def test_what_made_its_policy_robust_is_shown_too(tuned, monkeypatch, capsys):
    view = replace(RunView.read(tuned.directory), robust=object())
    monkeypatch.setattr(RunView, "read", lambda _: view)
    monkeypatch.setattr("openeureka.cli.show.robust_lines", lambda found: [f"robust: {found is view.robust}"])
    show(tuned.directory)
    assert capsys.readouterr().out.endswith("\n\nrobust: True\n")


def test_it_is_json_for_programs(toy, mine, tmp_path, capsys):
    tune(words(mine, tmp_path), as_json=True)
    printed = json.loads(capsys.readouterr().out)
    assert printed.pop("directory") == f"{tmp_path}/out"
    assert printed == json.loads(json.dumps(facts(RunView.read(tmp_path / "out"))))
    assert [number["name"] for number in printed["tuned"]["numbers"]] == ["WIDTH", "centred 0.25"]
    assert len(printed["tuned"]["trials"]) == 12
    assert set(printed["tuned"]["final"]) >= {"original", printed["tuned"]["after"]}


@pytest.mark.parametrize("again", [tune, resume])
def test_a_stopped_tuning_goes_on_with_the_same_words_or_with_resume(toy, mine, tmp_path, monkeypatch, again):
    whole = toy.result

    def result(lane):
        if len(toy.trained) > 8:
            raise KeyboardInterrupt
        return whole(lane)

    with monkeypatch.context() as once, pytest.raises(Interrupted, match=f"eureka resume {tmp_path}/out"):
        once.setattr(toy, "result", result)
        tune(words(mine, tmp_path))
    assert folder.entry("", tmp_path / "out").state is folder.RunState.STOPPED
    trained = toy.trained[:-1]
    toy.trained.clear()
    again(words(mine, tmp_path) if again is tune else [f"{tmp_path}/out"])
    assert not set(trained) & set(toy.trained)
    assert len([lane for lane in (*trained, *toy.trained) if lane.endswith("-s0")]) == 12
    assert folder.entry("", tmp_path / "out").state is folder.RunState.FINISHED


def test_the_human_reward_is_tuned_as_the_text_that_it_is(one_sandbox):
    config = TuneConfig(env="cartpole")
    candidate, verdict = to_tune(config, config.reward)
    assert candidate.source == human.program(get("cartpole")) and verdict.accepted


def test_the_best_reward_of_a_run_is_tuned(one_sandbox, tuned):
    candidate, _ = to_tune(TuneConfig(env="cartpole"), str(tuned.directory))
    assert candidate.source == (tuned.directory / "best" / "reward.py").read_text()
    with pytest.raises(
        ConfigError, match="is a run of cartpole; add env=cartpole, or name its reward file: reward=.*reward.py"
    ):
        to_tune(TuneConfig(env="ant"), str(tuned.directory))


def run_of(directory, **settings):
    Store.open(directory, RunConfig(**settings)).close()
    (directory / "best").mkdir()
    (directory / "best" / "reward.py").write_text(MINE)
    return directory


def test_the_reward_of_a_run_whose_task_has_moved_or_was_set_otherwise_is_tuned(one_sandbox, tmp_path):
    for number, env in enumerate(("/gone/cartpole.py:Cartpole", "cartpole+episode_length=100")):
        candidate, _ = to_tune(TuneConfig(env="cartpole"), str(run_of(tmp_path / str(number), env=env)))
        assert candidate.source == MINE


def test_what_is_not_taken_of_a_run_is_said(toy, tmp_path, capsys):
    run = run_of(tmp_path / "run", steps=350_000, worlds=64, bonus="progress", limits="effort=2")
    tune(words(run, tmp_path, "worlds=32"))
    said = capsys.readouterr().out
    assert (
        f"{run} trained with other settings. To tune its reward as it trained, add: steps=350000 bonus=progress\n"
        in said
    )
    assert f"The limits of {run} do not apply here: effort=2\n" in said
    assert left_out(TuneConfig(), "human") == left_out(TuneConfig(), MINE) == ""
    assert left_out(TuneConfig(), str(run_of(tmp_path / "usual"))) == ""


def test_a_reward_without_numbers_is_refused(toy, tmp_path, capsys):
    plain = tmp_path / "plain.py"
    plain.write_text("def compute_reward(pole_angle):\n    return -pole_angle.abs(), {}\n")
    with pytest.raises(SystemExit):
        main(["tune", f"reward={plain}", f"dir={tmp_path}/out"])
    error = capsys.readouterr().err
    assert "There is nothing to tune: `" in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_tuned_is_one_sentence(toy, tmp_path):
    bad = tmp_path / "bad.py"
    bad.write_text("import os\n" + MINE)
    with pytest.raises(RewardFileError, match="was refused: line 1: `os` cannot be imported"):
        to_tune(TuneConfig(), str(bad))
    with pytest.raises(ConfigError, match="`reward` names nothing to tune; write for example reward=human"):
        to_tune(TuneConfig(), "")
    with pytest.raises(ConfigError, match="sparse reward of a task is not a program"):
        to_tune(TuneConfig(), "sparse")
    with pytest.raises(
        TaskError, match=r"a method, not a program; name a file: reward=FILE.py, or a run: reward=DIR.$"
    ):
        to_tune(TuneConfig(env="gym:Pendulum-v1"), "human")
    empty = tmp_path / "outputs" / "empty"
    Store.open(empty, RunConfig()).close()
    with pytest.raises(
        RewardFileError, match="There is no program in .*/empty/best: its best reward came with the task, or nothing"
    ):
        to_tune(TuneConfig(), str(empty))
    with pytest.raises(StoreError, match="outputs is not a run: it holds runs; name one, such as .*/outputs/empty"):
        to_tune(TuneConfig(), str(empty.parent))


def test_a_run_of_another_reward_is_refused(toy, tuned, mine, tmp_path):
    mine.write_text(MINE.replace("8.0", "9.0"))
    with pytest.raises(StoreError, match="tunes another reward") as refused:
        tune(words(mine, tmp_path))
    assert not hasattr(refused.value, "__notes__"), "no advice to resume: that would not tune the other reward"


@pytest.mark.parametrize("again", [False, True])
def test_a_tuning_in_which_every_training_dies_says_why(toy, mine, tmp_path, monkeypatch, again):
    def result(lane):
        return TrainingResult(
            lane=lane.id, state=TrainingState.FAILED, fitness=None, curves={}, env_steps=0, seconds=0.0,
            message="Its worker ran out of memory.",
        )  # fmt: skip

    monkeypatch.setattr(toy, "result", result)
    with pytest.raises(WorkerError, match=r"^Its worker ran out of memory\.$"):
        tune(words(mine, tmp_path))
    if again:
        with pytest.raises(WorkerError, match=r"^Its worker ran out of memory\.$"):
            resume([f"{tmp_path}/out"])


@pytest.mark.parametrize("setting", ["trials=3", "sample=1", "seeds=0", "trials=1000000"])
def test_a_tuning_that_makes_no_sense_is_refused(setting):
    with pytest.raises(ConfigError, match=setting.partition("=")[0]):
        tune([setting])


def test_python_programs_tune_too(toy, tmp_path):
    events = []
    run = openeureka.tune("cartpole", MINE, trials=8, sample=4, seeds=2, dir=tmp_path / "out", on_event=events.append)
    assert run.finished and run.verdict.startswith("The tuned numbers are")
    assert run.tuned.trained == 8 and len(run.rows()) == len(run.view.lanes)
    assert {event.phase for event in events if isinstance(event, openeureka.Began)} == {
        *("check", "train", "play", "final", "evaluate")
    }
    assert openeureka.open_run(tmp_path / "out").resume().tuned == run.tuned
    with Store.view(tmp_path / "out") as store:
        assert store.rewards.named()["original"] is not None
