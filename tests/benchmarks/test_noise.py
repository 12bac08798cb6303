"""Play with and without noise: what the table counts."""

import json
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import noise
import pytest

from openeureka.config import RunConfig


def test_a_policy_that_fails_in_its_one_episode_and_succeeds_with_noise_is_counted():
    played = {"a-s0": [0.0, 0.9], "b-s0": [0.0, 0.5], "c-s0": [1.0, 1.0], "d-s0": [None, 1.0]}
    (row,) = noise.rows({"shadow_hand_pen": {"alike": True, "played": played}})
    assert row == ("shadow_hand_pen", "alike", "3", "0.3333", "0.8", "0.87", "1", "-", "-")


def test_seeds_of_one_reward_are_told_from_each_other():
    played = {"a-s0": [0.0, 0.8], "a-s1": [1.0, 0.9], "a-s2": [0.0, 1.0], "b-s0": [1.0, 0.5], "human-s0": [None, 0.1]}
    assert noise.between_seeds(played, 0) == pytest.approx((2 / 3 / 2) ** 0.5)  # b and human have one seed each
    assert noise.between_seeds(played, 1) == pytest.approx(0.1)


def test_policies_of_a_second_run_join_those_that_are_known(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    @contextmanager
    def store(directory: Path):
        yield SimpleNamespace(lanes=SimpleNamespace(policy=lambda lane, peak: lane))

    def evaluate(env: str, policies: Any, *, noise: bool, **_: Any) -> list[Any]:
        return [SimpleNamespace(lane=lane, fitness=float(noise)) for lane in policies]

    (tmp_path / "second" / "lanes" / "b-s0").mkdir(parents=True)
    monkeypatch.setattr(noise, "RESULTS", tmp_path / "noise.json")
    monkeypatch.setattr(noise.openeureka, "open_run", lambda _: SimpleNamespace(config=RunConfig(env="ant")))
    monkeypatch.setattr(noise.fresh, "noisy", lambda env: False)
    monkeypatch.setattr(noise, "evaluate", evaluate)
    monkeypatch.setattr(noise, "Store", SimpleNamespace(view=store))
    known = {"ant": {"alike": False, "played": {"a-s0": [0.5, 0.5]}, "runs": {"first": {"lanes": ["a-s0"]}}}}
    noise.RESULTS.write_text(json.dumps(known))
    env, row = noise.measure(tmp_path / "second")
    assert env == "ant" and row["played"] == {"a-s0": [0.5, 0.5], "b-s0": [0.0, 1.0]}
    assert row["runs"]["first"] == {"lanes": ["a-s0"]} and row["runs"]["second"]["lanes"] == ["b-s0"]
