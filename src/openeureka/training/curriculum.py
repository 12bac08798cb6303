"""Trains lanes through the stages of a curriculum: each goes on from the policy it left the stage before with."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from functools import partial

from ..store.lane_log import StageFiles
from ..tasks.task import Stage
from ..types import LaneSpec, TrainBudget, Trainer, TrainingEvent, TrainingProgress, TrainingResult, TrainingState


class CurriculumTrainer:
    """A `types.Trainer` that takes every lane through all stages, all lanes of a stage at once.

    A lane goes on from where it ended, not from a peak: F guides no training, and the peak of a noisy reward may be an
    early one. Curves, F and checkpoints of its result are those of the last stage, the task itself; steps and seconds
    are sums. A lane that diverges or fails earlier ends there, without an F. Lanes pause in the last stage alone, at
    that share of it. Where all lanes go on from policies, those have been through it: they train the task alone.

    Args:
        trainer: trains each stage.
        stages: as `tasks.curriculum.find` gives them.
        finished: where finished stages are looked up and left, by number from 1.
    """

    def __init__(self, trainer: Trainer, stages: Sequence[Stage], finished: StageFiles) -> None:
        self._trainer, self._stages, self._finished = trainer, stages, finished
        self.evaluate, self.rewards = trainer.evaluate, trainer.rewards

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[TrainingEvent]:
        """Train every lane. The budget's steps, if any, are shared out among the stages in proportion to their own."""
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
        """What an event of one stage is in all of it; nothing where a lane passed the stage."""
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
        """What is left of a finished stage, then the rest as it is trained."""
        known = {lane.id: self._finished.read(number, lane.id) for lane in lanes}
        yield from (result for result in known.values() if result is not None)
        missing = [lane for lane in lanes if known[lane.id] is None]
        if missing:
            yield from _each(self._trainer.train(stage.env, missing, budget), partial(self._kept, number))

    def _kept(self, number: int, event: TrainingEvent) -> TrainingEvent:
        """The event, once it is safe: a stage that failed trains again."""
        if isinstance(event, TrainingResult) and event.state is not TrainingState.FAILED:
            self._finished.save(number, event)
        return event


def _each(
    events: Iterator[TrainingEvent], tell: Callable[[TrainingEvent], TrainingEvent | None]
) -> Iterator[TrainingEvent]:
    """What `tell` makes of each event. Who trains is told of a stop, and still heard, and closed in the end."""
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
    """What still comes after a stop."""
    with suppress(StopIteration):
        yield events.throw(stop)
        yield from events


def shares(stages: Sequence[Stage], total: int) -> list[int]:
    """Environment steps of each stage; a `total` other than 0 is shared out in proportion to the stages' own."""
    own = [stage.steps for stage in stages]
    return [max(1, total * steps // sum(own)) for steps in own] if total else own


def _overall(progress: TrainingProgress, steps: Sequence[int], number: int) -> TrainingProgress:
    """Progress of one stage as part of the whole curriculum; an earlier stage says nothing of F."""
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
    """The last stage's result, with what all stages took; its steps and clock go on from the earlier ones'."""
    env_steps, seconds = sum(result.env_steps for result in results), sum(result.seconds for result in results)
    clock = tuple(seconds - results[-1].seconds + time for time in results[-1].clock)
    before = env_steps - results[-1].env_steps
    return dataclasses.replace(results[-1], env_steps=env_steps, steps_before=before, seconds=seconds, clock=clock)


def _lost(results: Sequence[TrainingResult]) -> TrainingResult:
    """The result of a lane that ended before the last stage: what it scored there is no F of the task."""
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
