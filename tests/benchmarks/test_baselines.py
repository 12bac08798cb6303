"""Human and sparse F of every task: measured once, kept, summarised and shipped."""

import json
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import baselines
import pytest

import openeureka
from openeureka.method import baselines as shipped
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import TrainingState

ROOT = Path(__file__).parents[2]


@pytest.fixture
def go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Runs the script with toy trainings: F is 10 (human) or 5 (sparse) plus seed / 100, and one less held out."""
    trainer = ToyTrainer()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: trainer)

    def go(*words: str) -> list[str]:
        """Returns the lanes that this call trained."""
        trainer.trained.clear()
        files = {"--dir": "runs", "--out": "all.json", "--shipped": "shipped.json"}
        baselines.main([*words, *(word for key, name in files.items() for word in (key, str(tmp_path / name)))])
        return list(trainer.trained)

    return go


def test_every_reward_and_seed_is_a_lane_of_one_training(go, tmp_path):
    assert go("--env", "ant", "--seeds", "2") == ["human-s0", "human-s1", "sparse-s0", "sparse-s1"]
    ant = json.loads((tmp_path / "all.json").read_text())["ant"]
    assert (ant["env_steps"], ant["worlds"]) == (6_000_000, 512)
    lane = ant["lanes"]["human-s1"]
    assert lane["fitness_at_first"] == pytest.approx(10.01 / 2)
    assert lane["fitness_max_over_epochs"] == 10.01
    assert lane["held_out_at_peak_of_fitness"] == lane["held_out_at_peak_of_reward"]
    assert lane["held_out_at_peak_of_reward"]["fitness"] == pytest.approx(9.01)
    assert lane["training"]["lanes"] == 4
    assert {"date", "device", "minutes", "versions"} <= set(lane["training"])


def test_what_is_known_is_not_repeated(go, tmp_path):
    go("--env", "ant", "--seeds", "1")
    go("--env", "cartpole", "--seeds", "1")
    assert go("--env", "ant", "--env", "cartpole", "--seeds", "1") == []
    assert go("--env", "ant", "--seeds", "2") == ["human-s1", "sparse-s1"]
    found = json.loads((tmp_path / "all.json").read_text())
    assert {env: list(entry["lanes"]) for env, entry in found.items()} == {
        "ant": ["human-s0", "human-s1", "sparse-s0", "sparse-s1"],
        "cartpole": ["human-s0", "sparse-s0"],
    }


def test_what_an_older_record_does_not_say_was_as_it_is_by_default(go, tmp_path):
    go("--env", "ant", "--seeds", "1")
    file = tmp_path / "all.json"
    found = json.loads(file.read_text())
    del found["ant"]["recipe"]["bootstrap_timeouts"]
    file.write_text(json.dumps(found))
    assert go("--env", "ant", "--seeds", "1") == []
    found["ant"]["recipe"]["epochs"] = 99
    file.write_text(json.dumps(found))
    with pytest.raises(SystemExit, match="another recipe"):
        go("--env", "ant", "--seeds", "1")


def test_a_lane_that_diverged_is_a_result_and_one_that_died_is_none(go, tmp_path, monkeypatch):
    states = {"human-s0": TrainingState.FAILED, "sparse-s0": TrainingState.DIVERGED}
    train = ToyTrainer.result
    monkeypatch.setattr(ToyTrainer, "result", lambda self, lane: replace(train(self, lane), state=states[lane.id]))
    go("--env", "ant", "--seeds", "1")
    assert list(json.loads((tmp_path / "all.json").read_text())["ant"]["lanes"]) == ["sparse-s0"]
    assert go("--env", "ant", "--seeds", "1") == [], "the run remembers the failed lane"
    assert go("--env", "ant", "--seeds", "1", "--again") == ["human-s0", "sparse-s0"]


def test_what_no_lane_survives_is_said_in_a_sentence_and_tried_again(go, monkeypatch):
    train = ToyTrainer.result
    dead = {"state": TrainingState.FAILED, "message": "There is no memory."}
    with monkeypatch.context() as patch:
        patch.setattr(ToyTrainer, "result", lambda self, lane: replace(train(self, lane), **dead))
        with pytest.raises(SystemExit, match="There is no memory"):
            go("--env", "ant", "--seeds", "1")
    assert go("--env", "ant", "--seeds", "1") == ["human-s0", "sparse-s0"]


DIES_IN_THE_THIRD = """
import os, signal, sys
import openeureka.executors.local as local
from openeureka.testing.scripted import ToyTrainer

train = ToyTrainer.result

def result(self, lane):
    if lane.id == "sparse-s0":
        os.kill(os.getpid(), signal.SIGKILL)
    return train(self, lane)

ToyTrainer.result, local.LocalExecutor = result, lambda **_: ToyTrainer()
import baselines
baselines.main(sys.argv[1:])
"""


def test_one_that_is_killed_goes_on_with_the_same_command(go, tmp_path):
    files = {"--dir": "runs", "--out": "all.json", "--shipped": "shipped.json"}
    words = ["--env", "ant", "--seeds", "2", *(w for key, name in files.items() for w in (key, str(tmp_path / name)))]
    killed = subprocess.run([sys.executable, "-c", DIES_IN_THE_THIRD, *words], cwd=ROOT / "benchmarks")
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "all.json").exists()
    assert go("--env", "ant", "--seeds", "2") == ["sparse-s0", "sparse-s1"]
    found = json.loads((tmp_path / "all.json").read_text())
    assert list(found["ant"]["lanes"]) == ["human-s0", "human-s1", "sparse-s0", "sparse-s1"]


def test_it_is_a_run_that_more_seeds_go_on_with(go, tmp_path):
    go("--env", "ant", "--seeds", "2", "--reward", "sparse")
    go("--env", "ant", "--seeds", "3")
    run = openeureka.open_run(tmp_path / "runs" / "ant")
    assert run.finished and run.report.is_file()
    assert [lane.held_out.fitness for lane in run.lanes.values()] == pytest.approx([4, 4.01, 9, 9.01, 9.02, 4.02])
    assert run._policy("best") == b"10.02"


def test_numbers_of_another_budget_are_not_mixed_in(go):
    go("--env", "ant", "--seeds", "1")
    with pytest.raises(SystemExit, match="holds ant with another env_steps and worlds"):
        go("--env", "ant", "--seeds", "2", "--steps", "1e6", "--worlds", "64")
    assert go("--env", "ant", "--seeds", "1", "--steps", "1e6", "--again") == ["human-s0", "sparse-s0"]


def test_further_seeds_take_the_steps_that_the_first_had(go, tmp_path):
    go("--env", "ant", "--seeds", "1", "--steps", "1e6", "--worlds", "64")
    assert go("--env", "ant", "--seeds", "2") == ["human-s1", "sparse-s1"]
    assert json.loads((tmp_path / "all.json").read_text())["ant"]["env_steps"] == 1_000_000
    go("--env", "ant", "--seeds", "1", "--again")
    ant = json.loads((tmp_path / "all.json").read_text())["ant"]
    assert (ant["env_steps"], ant["worlds"]) == (6_000_000, 512)


@pytest.mark.usefixtures("go")
def test_the_package_s_summary_is_of_the_committed_file_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(baselines, "RESULTS", tmp_path / "committed.json")
    monkeypatch.setattr(baselines, "SHIPPED", tmp_path / "shipped.json")
    words = ("--env", "ant", "--seeds", "1", "--dir", str(tmp_path / "runs"))
    baselines.main([*words, "--out", str(tmp_path / "other.json")])
    assert (tmp_path / "other.json").exists() and not (tmp_path / "shipped.json").exists()
    baselines.main(words)
    assert (tmp_path / "shipped.json").exists()


def test_the_package_reads_the_summary(go, tmp_path, monkeypatch):
    go("--env", "ant", "--seeds", "2")
    monkeypatch.setattr(shipped, "_shipped", lambda: json.loads((tmp_path / "shipped.json").read_text()))
    known = shipped.known("ant", played=True)
    assert known is not None
    assert known.human.training == (10.0, 10.01)
    assert known.sparse.held_out == pytest.approx((4.0, 4.01))
    assert (known.env_steps, known.worlds) == (6_000_000, 512)
    assert shipped.known("some/file.py:Task") is None


def test_seeds_are_in_their_own_order():
    lane = {
        "fitness_max_over_epochs": 0.0,
        "held_out_at_peak_of_fitness": {"fitness": None, "episode_length": None},
        "held_out_at_peak_of_reward": {"fitness": None, "episode_length": None},
        "training": {"device": "a GPU", "date": "2026-01-01"},
    }
    lanes = {f"human-s{seed}": {**lane, "fitness_max_over_epochs": seed} for seed in reversed(range(12))}
    entry = baselines.summary({"ant": {"env_steps": 1, "worlds": 1, "lanes": lanes}})["ant"]
    assert entry["human"]["training"] == list(range(12))


def test_what_is_shipped_is_the_summary_of_what_was_measured():
    assert baselines.read(baselines.SHIPPED) == baselines.summary(baselines.read(baselines.RESULTS))
