"""The numbers of a cell, from searches whose trainings take given times and costs."""

from dataclasses import replace
from pathlib import Path

import pytest
from loop.alone import Killed, run

from openeureka import strategies
from openeureka.benchmark import figures
from openeureka.benchmark.figures import Result
from openeureka.benchmark.plan import Cell
from openeureka.config import RunConfig
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program, reply
from openeureka.types import Candidate, LaneSpec, TrainingResult


def read(directory: Path, trainer: ToyTrainer, worths: list[float], **settings) -> Result:
    config = RunConfig(sample=len(worths), iteration=1, repair=0, refill=0, seeds=2, **settings)
    with Store.open(directory, config) as store:
        model = ScriptedModel([reply(worth) for worth in worths])
        run(config, store, model, ToyChecker(), trainer, TOY, strategies.make(config))
    found = figures.read(Cell("cartpole", "full", 0), directory)
    assert found is not None
    return found


def test_the_curve_counts_no_reward_that_breaks_a_limit(tmp_path: Path) -> None:
    class Costly(ToyTrainer):
        def evaluate(self, env, policies, *, seed, **options):
            for score in super().evaluate(env, policies, seed=seed, **options):
                yield replace(score, costs={"torque": 10 * float(policies[score.lane])})

    # Each reward trains for 3 steps and plays one less than it is worth. The one worth 8 needs a torque of 80.
    assert read(tmp_path / "free", Costly(), [6, 8, 7.5]).curve == ((3, 5.0), (6, 7.0))
    assert read(tmp_path / "bound", Costly(), [6, 8, 7.5], limits="torque=76").curve == ((3, 5.0), (9, 6.5))


def test_minutes_are_those_of_the_longest_of_what_trains_side_by_side(tmp_path: Path) -> None:
    class Slow(ToyTrainer):
        def result(self, lane: LaneSpec) -> TrainingResult:
            return replace(super().result(lane), seconds=60.0 * minutes[lane.id])

    first, second = (Candidate.of(program(worth)).id for worth in (7, 8))
    minutes = {f"{first}-s0": 1, f"{second}-s0": 2, "human-s0": 3, "sparse-s0": 1}
    minutes |= {f"{second}-s1": 1, f"{second}-s2": 4, "human-s1": 2, "human-s2": 1}
    found = read(tmp_path, Slow(), [7, 8])
    # 3 minutes in the generation, 4 in the final trainings.
    assert found.minutes == 7.0
    # 3 steps each: two candidates in the search, and six more trainings.
    assert (found.search_steps, found.steps) == (6, 24)
    # The better reward plays 7, and 0.01 more with each later seed.
    assert found.held_out == pytest.approx(7.015)


def test_a_search_that_is_not_over_has_no_numbers(tmp_path: Path) -> None:
    class Dies(ToyTrainer):
        def result(self, lane: LaneSpec) -> TrainingResult:
            if lane.seed:  # in the final trainings
                raise Killed
            return super().result(lane)

    with pytest.raises(Killed):
        read(tmp_path, Dies(), [7, 8])
    assert figures.read(Cell("cartpole", "full", 0), tmp_path) is None
