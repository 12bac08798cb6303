"""What is kept of a training that is stopped, or fails, while its results come."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from openeureka.config import RunConfig
from openeureka.events import Event, nobody
from openeureka.method.lanes import Lanes
from openeureka.method.seeds import (
    deal,
    final_lanes,
    final_seeds,
    polish_seeds,
    trained_baselines,
    tuning_seeds,
    unused_seed,
)
from openeureka.store import Store
from openeureka.store.lane_log import LaneLog
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import LaneSpec, TrainBudget, TrainingProgress, TrainingResult

LANES = deal(trained_baselines(RunConfig()), [0, 1], "baseline")


def test_no_seed_has_two_tasks() -> None:
    """What one step of a run chooses, the next judges with other seeds; after all of them come unused ones."""
    run = RunConfig(seed=10, seeds=3, polish=2, tune=4)
    ranges = final_seeds(run), polish_seeds(run), tuning_seeds(run)
    assert [run.seed, *(seed for own in ranges for seed in own)] == list(range(10, 19))
    assert [len(own) for own in ranges] == [3, 2, 3] and unused_seed(run) == 19
    assert unused_seed(replace(run, tune=0)) == 16
    alone = RunConfig(seed=10, seeds=3, tune=4, model="none")  # a tuning of a given reward: no search
    assert tuning_seeds(alone) == range(11, 14)


def test_the_first_training_of_a_baseline_counts_once_it_has_a_score() -> None:
    run, trained = RunConfig(seeds=2), {"human-s0", "human-s1", "sparse-s0"}
    assert final_lanes(run, [], trained, {"human-s0"}) == {"human": ["human-s0", "human-s1"], "sparse": []}
    assert final_lanes(run, [], trained, {}) == {"human": ["human-s1"], "sparse": []}


class Sends(ToyTrainer):
    """Has every result when it is stopped, like workers whose training has ended."""

    stopped = False

    def train(
        self, env: str, specs: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        events = list(super().train(env, specs, budget))
        told = 0
        try:
            for event in events:
                told += 1
                yield event
        except KeyboardInterrupt:
            self.stopped = True
            yield from (event for event in events[told:] if isinstance(event, TrainingResult))
            raise


class Listed(ToyTrainer):
    """Trains in a plain iterator, not a generator, so it does not notice a stop."""

    def train(
        self, env: str, specs: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        return iter(list(super().train(env, specs, budget)))


class StopsOnce:
    """A listener during which Ctrl-C is pressed, at the first result."""

    stopped = False

    def __call__(self, event: Event) -> None:
        if isinstance(event, TrainingResult) and not self.stopped:
            self.stopped = True
            raise KeyboardInterrupt


@pytest.mark.parametrize(("trainer", "kept"), [(Sends(), 4), (Listed(), 1)])
def test_ctrl_c_between_two_results_loses_none_that_has_come(tmp_path: Path, trainer: ToyTrainer, kept: int):
    with Store.open(tmp_path, RunConfig()) as store:
        with pytest.raises(KeyboardInterrupt):
            Lanes(RunConfig(), store, trainer, StopsOnce()).train(LANES)
        assert len(store.lanes.results()) == kept


def test_a_result_that_was_being_kept_at_ctrl_c_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    save, calls = LaneLog.save_results, list[int]()

    def interrupted(log: LaneLog, results: Sequence[TrainingResult]) -> None:
        calls.append(len(results))
        if len(calls) == 1:
            raise KeyboardInterrupt
        save(log, results)

    monkeypatch.setattr(LaneLog, "save_results", interrupted)
    trainer = Sends()
    with Store.open(tmp_path, RunConfig()) as store:
        with pytest.raises(KeyboardInterrupt):
            Lanes(RunConfig(), store, trainer, nobody).train(LANES)
        assert len(store.lanes.results()) == 4 and trainer.stopped


def test_who_trains_is_told_of_the_end_also_where_somebody_keeps_the_error(tmp_path: Path):
    class Ends(ToyTrainer):
        ended = False

        def train(
            self, env: str, specs: Sequence[LaneSpec], budget: TrainBudget
        ) -> Iterator[TrainingProgress | TrainingResult]:
            try:
                yield from super().train(env, specs, budget)
            finally:
                self.ended = True

    def full(event: Event) -> None:
        if isinstance(event, TrainingProgress):
            raise ValueError("The disk is full.")

    trainer = Ends()
    with Store.open(tmp_path, RunConfig()) as store:
        with pytest.raises(ValueError, match="full") as kept:
            Lanes(RunConfig(), store, trainer, full).train(LANES)
        assert trainer.ended and kept.tb is not None
