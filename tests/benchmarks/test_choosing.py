"""What a ranking is worth, from the records of lanes."""

from pathlib import Path
from typing import Any

import choosing
import pytest
import screening

from openeureka.store import look
from openeureka.testing.scripted import ToyTrainer


def lane(played: float, held_out: float) -> dict[str, Any]:
    one = {"fitness": played, "episodes": 64}
    judged = {peak: {"fitness": held_out} for peak in ("reward", "fitness")}
    return {"training": played, "played": {"reward": [one]}, "held_out": judged}


@pytest.fixture
def measured() -> dict[str, Any]:
    """Four rewards that play 4, 3, 2 and 1 in a search; with fresh seeds they are worth 10, 40, 20 and 0."""
    worth = {"a": (4.0, 10.0), "b": (3.0, 40.0), "c": (2.0, 20.0), "d": (1.0, 0.0), "human": (2.0, 15.0)}
    lanes = {f"{name}-s0": lane(played, played) for name, (played, _) in worth.items()}
    lanes |= {f"{name}-s{seed}": lane(fresh, fresh) for name, (_, fresh) in worth.items() for seed in (1, 2)}
    return {"ant": {"lanes": lanes}}


def test_f_of_the_one_chosen_from_so_many_is_that_of_all_draws(measured: dict[str, Any]) -> None:
    ((task, one, two, four, best, human),) = choosing.fewer(measured)
    # Of the six pairs, a leads three (10), b two (40), and c one (20).
    assert (task, one, two, four) == ("ant", "17.5", "21.67", "10")
    assert (best, human) == ("40", "15")


def test_of_rewards_that_play_alike_each_may_be_the_one(measured: dict[str, Any]) -> None:
    measured["ant"]["lanes"]["b-s0"] = lane(4.0, 4.0)
    ((_, one, two, four, _, _),) = choosing.fewer(measured)
    # a and b are level, so a pair of both counts as 25. a leads two other pairs (10), b two (40), and c one (20).
    assert (one, two, four) == ("17.5", "24.17", "25")
    ((*_, first, racing, _, _),) = choosing.ranking(measured)
    assert (first, racing) == ("25", "40")
    measured["ant"]["lanes"]["b-s0"] = measured["ant"]["lanes"]["d-s0"] = lane(2.0, 2.0)
    ((*_, racing, _, _),) = choosing.ranking(measured)
    assert racing == "33.33"  # a races with two of b, c and d; the best of each race: 40, 40, 20


def test_a_task_without_fresh_seeds_has_no_row(measured: dict[str, Any]) -> None:
    lanes = {name: one for name, one in measured["ant"]["lanes"].items() if name.endswith("-s0")}
    assert choosing.fewer({"ant": {"lanes": lanes}}) == []


def test_what_is_measured_is_not_repeated_and_its_run_has_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    trainer = ToyTrainer()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: trainer)
    monkeypatch.setattr(choosing, "OUTPUTS", tmp_path)
    monkeypatch.setattr(choosing, "programs", lambda *_: [("human", "human")])
    monkeypatch.setattr(choosing, "RESULTS", tmp_path / "choosing.json")
    for _ in range(2):
        choosing.measure("ballbalance", 0)
    assert trainer.trained == ["human-s0"]
    assert look(tmp_path / "choosing" / "ballbalance")[1].ended


def test_a_run_whose_rewards_are_screened_has_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: ToyTrainer())
    monkeypatch.setattr(screening, "OUTPUTS", tmp_path)
    monkeypatch.setattr(screening, "graphs", lambda *_: {})
    screening.trained("ballbalance")
    assert look(tmp_path / "screening" / "ballbalance")[1].ended
