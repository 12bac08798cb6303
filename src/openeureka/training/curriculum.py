"""Trains lanes through the stages of a curriculum: each stage begins with the last policy of the stage before."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from functools import partial

from ..store.stages import StageFiles
from ..tasks.task import Stage
from ..types import LaneSpec, TrainBudget, Trainer, TrainingEvent, TrainingProgress, TrainingResult, TrainingState


class CurriculumTrainer:
    """A `types.Trainer` that takes every lane through all stages, all lanes of a stage at once.

    A lane continues from its last policy, not from a peak: F guides no training, and the peak of a noisy reward may be
    an early one. Curves, F and checkpoints of its result are those of the last stage, which is the task itself; steps
    and seconds are sums over all stages. A lane that diverges or fails in an earlier stage ends there, without an F.
    Lanes pause in the last stage only, at the budget's share of it. Where all lanes continue policies (`start`), these
    have been through the curriculum: the lanes train the last stage only.

    Args:
        trainer: trains each stage.
        stages: as `tasks.curriculum.find` gives them.
        finished: store of the results of finished stages, by stage number from 1.
    """

    def __init__(self, trainer: Trainer, stages: Sequence[Stage], finished: StageFiles) -> None:
        self._trainer, self._stages, self._finished = trainer, stages, finished
        self.evaluate, self.rewards = trainer.evaluate, trainer.rewards

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[TrainingEvent]:
        """Train every lane. The budget's steps, if any, are split in proportion to the stages' own steps."""
        if lanes and all(lane.start is not None for lane in lanes):
            yield from self._trainer.train(env, lanes, budget)
            return
        steps = shares(self._stages, budget.env_steps)
        passed: dict[str, list[TrainingResult]] = {lane.id: [] for lane in lanes}
        paused = {lane.id: lane.paused for lane in lanes}
        lanes = [dataclasses.replace(lane, paused=None) for lane in lanes]
        for number, stage in enumerate(self._stages, start=1):
            last = number == len(self._stages)
            part = dataclasses.replace(budget, env_steps=steps[number - 1], until=budget.until if last else 1.0)
            if last:
                lanes = [dataclasses.replace(lane, paused=paused[lane.id]) for lane in lanes]
            train = self._trainer.train(env, lanes, part) if last else self._remembered(number, stage, lanes, part)
            yield from _each(train, partial(self._told, number, steps, passed))
            lanes = [
                dataclasses.replace(lane, start=passed[lane.id][-1].last)
                for lane in lanes
                if len(passed[lane.id]) == number
            ]
            if not lanes:
                return

    def _told(
        self, number: int, steps: Sequence[int], passed: Mapping[str, list[TrainingResult]], event: TrainingEvent
    ) -> TrainingEvent | None:
        """One stage's event as one of the whole curriculum; None for the result of a lane that has a next stage."""
        if isinstance(event, TrainingProgress):
            return _overall(event, steps, number)
        before = passed[event.lane]
        if number == len(self._stages):
            return _summed([*before, event])
        if event.last is None:
            return _lost([*before, event])
        before.append(event)
        return None

    def _remembered(
        self, number: int, stage: Stage, lanes: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingEvent]:
        """Stored results of the lanes that finished this stage, then events of the others as they train."""
        known = {lane.id: self._finished.read(number, lane.id) for lane in lanes}
        yield from (result for result in known.values() if result is not None)
        missing = [lane for lane in lanes if known[lane.id] is None]
        if missing:
            yield from _each(self._trainer.train(stage.env, missing, budget), partial(self._kept, number))

    def _kept(self, number: int, event: TrainingEvent) -> TrainingEvent:
        """The event, after storing a result. A FAILED one is not stored, so that the stage trains again."""
        if isinstance(event, TrainingResult) and event.state is not TrainingState.FAILED:
            self._finished.save(number, event)
        return event


def _each(
    events: Iterator[TrainingEvent], tell: Callable[[TrainingEvent], TrainingEvent | None]
) -> Iterator[TrainingEvent]:
    """What `tell` makes of each event, without None.

    A KeyboardInterrupt is thrown into the trainer's generator. Events that it still yields are passed on, then the
    generator is closed.
    """
    if not isinstance(events, Generator):
        yield from filter(None, map(tell, events))
        return
    with closing(events):
        for event in events:
            try:
                if (told := tell(event)) is not None:
                    yield told
            except KeyboardInterrupt as stop:
                yield from _each(_late(events, stop), tell)
                raise


def _late(events: Generator[TrainingEvent], stop: KeyboardInterrupt) -> Iterator[TrainingEvent]:
    """Events that the trainer yields after a stop."""
    with suppress(StopIteration):
        yield events.throw(stop)
        yield from events


def shares(stages: Sequence[Stage], total: int) -> list[int]:
    """Environment steps of each stage; a `total` other than 0 is split in proportion to the stages' own steps."""
    own = [stage.steps for stage in stages]
    return [max(1, total * steps // sum(own)) for steps in own] if total else own


def _overall(progress: TrainingProgress, steps: Sequence[int], number: int) -> TrainingProgress:
    """Progress of one stage as progress of the whole curriculum; F of an earlier stage is left out."""
    epochs = round(progress.epochs * sum(steps) / steps[number - 1])
    before = round(epochs * sum(steps[: number - 1]) / sum(steps))
    overall = dataclasses.replace(progress, epoch=min(before + progress.epoch, epochs), epochs=epochs)
    if number == len(steps):
        return overall
    latest = {
        lane: {name: value for name, value in own.items() if name != "fitness"} for lane, own in progress.latest.items()
    }
    return dataclasses.replace(overall, fitness=dict.fromkeys(progress.fitness), latest=latest)


def _summed(results: Sequence[TrainingResult]) -> TrainingResult:
    """The last result with the steps and seconds of all; `steps_before` and clock count the earlier stages."""
    env_steps, seconds = sum(result.env_steps for result in results), sum(result.seconds for result in results)
    clock = tuple(seconds - results[-1].seconds + time for time in results[-1].clock)
    before = env_steps - results[-1].env_steps
    return dataclasses.replace(results[-1], env_steps=env_steps, steps_before=before, seconds=seconds, clock=clock)


def _lost(results: Sequence[TrainingResult]) -> TrainingResult:
    """The result of a lane that ended before the last stage: without F, which an earlier stage's score is not."""
    result = _summed(results)
    curves = {**result.curves, "fitness": tuple(None for _ in result.curves.get("fitness", ()))}
    return dataclasses.replace(
        result,
        fitness=None,
        curves=curves,
        best_fitness=None,
        best_reward=None,
        last=None,
        message=f"Stage {len(results)}: {result.message}",
    )
