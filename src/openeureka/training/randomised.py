"""Trains lanes in worlds that differ, and plays policies in the task's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from ..types import (
    Dynamics,
    Evaluation,
    LaneSpec,
    Ranges,
    TrainBudget,
    Trainer,
    TrainingProgress,
    TrainingResult,
)


class RandomisedTrainer:
    """A `types.Trainer` that adds ranges to every budget.

    Args:
        trainer: trains each budget.
        ranges: as `tasks.ranges.find` gives them.
    """

    def __init__(self, trainer: Trainer, ranges: Ranges) -> None:
        self._trainer, self._ranges = trainer, ranges

    def train(
        self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        return self._trainer.train(env, lanes, replace(budget, randomise=self._ranges))

    def evaluate(
        self,
        env: str,
        policies: Mapping[str, bytes],
        *,
        seed: int,
        episodes: int = 0,
        dynamics: Mapping[str, Dynamics] | None = None,
    ) -> Iterator[Evaluation]:
        return self._trainer.evaluate(env, policies, seed=seed, episodes=episodes, dynamics=dynamics)
