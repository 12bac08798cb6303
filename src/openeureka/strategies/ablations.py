"""The paper's ablations as searches: what is left when a part of the method is taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from random import Random

from ..config import RunConfig
from ..types import History, PromptPlan, Scored
from .strategy import Best


@dataclass(frozen=True, slots=True)
class Unreflected(Best):
    """`best` without reward reflection (arXiv 2310.12931, section 4.3): the model is told how high each reward scores,
    and nothing of its components or of other rewards."""

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        return [
            replace(plan, turns=tuple(map(_bare, plan.turns)), siblings=()) for plan in Best.ask(self, history, rng)
        ]


def _bare(entry: Scored) -> Scored:
    score = f"{entry.fitness:.2f}" if entry.fitness is not None else "none"
    return replace(entry, feedback=f"task_score, at best in training: {score}")


def unreflected(config: RunConfig) -> Unreflected:
    """For `search=openeureka.strategies.ablations:unreflected`."""
    return Unreflected(config.sample)
