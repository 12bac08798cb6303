"""Human and sparse F of every task: measured once, kept, summarised and shipped."""

import json
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from openeureka import baselines as shipped
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import TrainingState

ROOT = Path(__file__).parents[2]


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    import baselines

    return baselines


@pytest.fixture
def go(benchmark: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Runs the script with toy trainings: human F is 10, sparse 5, plus a hundredth of the seed, one less held out."""
    trainer = ToyTrainer()
    monkeypatch.setattr(benchmark, "LocalExecutor", lambda *_, **__: trainer)

    def go(*words: str) -> list[str]:
        """Lanes trained by this call."""
        trainer.trained.clear()
        benchmark.main([*words, "--out", str(tmp_path / "all.json"), "--shipped", str(tmp_path / "shipped.json")])
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


def test_a_lane_that_died_is_trained_again_and_one_that_diverged_is_not(go, monkeypatch):
    states = {"human-s0": TrainingState.FAILED, "sparse-s0": TrainingState.DIVERGED}
    train = ToyTrainer._result
    monkeypatch.setattr(ToyTrainer, "_result", lambda self, lane: replace(train(self, lane), state=states[lane.id]))
    go("--env", "ant", "--seeds", "1")
    assert go("--env", "ant", "--seeds", "1") == ["human-s0"]


def test_numbers_of_another_budget_are_not_mixed_in(go):
    go("--env", "ant", "--seeds", "1")
    with pytest.raises(SystemExit, match="holds ant with another env_steps and worlds"):
        go("--env", "ant", "--seeds", "2", "--steps", "1e6", "--worlds", "64")
    assert go("--env", "ant", "--seeds", "1", "--steps", "1e6", "--again") == ["human-s0", "sparse-s0"]


def test_the_package_reads_the_summary(go, tmp_path, monkeypatch):
    go("--env", "ant", "--seeds", "2")
    monkeypatch.setattr(shipped, "_shipped", lambda: json.loads((tmp_path / "shipped.json").read_text()))
    known = shipped.known("ant", "reward")
    assert known is not None
    assert known.human.training == (10.0, 10.01)
    assert known.sparse.held_out == pytest.approx((4.0, 4.01))
    assert (known.env_steps, known.worlds) == (6_000_000, 512)
    assert shipped.known("some/file.py:Task") is None


def test_seeds_are_in_their_own_order(benchmark):
    lane = {
        "fitness_max_over_epochs": 0.0,
        "held_out_at_peak_of_fitness": {"fitness": None, "episode_length": None},
        "held_out_at_peak_of_reward": {"fitness": None, "episode_length": None},
        "training": {"device": "a GPU", "date": "2026-01-01"},
    }
    lanes = {f"human-s{seed}": {**lane, "fitness_max_over_epochs": seed} for seed in reversed(range(12))}
    entry = benchmark.summary({"ant": {"env_steps": 1, "worlds": 1, "lanes": lanes}})["ant"]
    assert entry["human"]["training"] == list(range(12))


def test_what_is_shipped_is_the_summary_of_what_was_measured(benchmark):
    assert benchmark.read(benchmark.SHIPPED) == benchmark.summary(benchmark.read(benchmark.RESULTS))
