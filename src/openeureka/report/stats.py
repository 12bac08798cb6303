"""Numbers about a search, computed from its history alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from ..score import mean
from ..types import Generation, History, TrainingState, VerdictCode


@dataclass(frozen=True, slots=True, kw_only=True)
class GenerationStats:
    """One generation in numbers."""

    index: int
    slots: int
    verdicts: Mapping[VerdictCode, int]
    replies: int
    """Replies spent, repairs and refills included."""
    trained: int
    """Slots whose training finished with a score."""
    best: float | None
    mean: float | None
    """Over the trained slots."""


def by_generation(history: History) -> tuple[GenerationStats, ...]:
    """Statistics of each generation, in order."""
    return tuple(_of(generation) for generation in history.generations)


def _of(generation: Generation) -> GenerationStats:
    finished = [e for e in generation.entries if e.result is not None and e.result.state is TrainingState.FINISHED]
    scores = [entry.score for entry in finished if entry.score is not None]
    return GenerationStats(
        index=generation.index,
        slots=len(generation.entries),
        verdicts=Counter(entry.sample.verdict.code for entry in generation.entries),
        replies=sum(entry.sample.attempts for entry in generation.entries),
        trained=len(scores),
        best=generation.best.score if generation.best else None,
        mean=mean(scores),
    )


def best_so_far(history: History) -> tuple[float | None, ...]:
    """Highest score up to and including each generation."""
    best: float | None = None
    curve = []
    for generation in history.generations:
        score = generation.best.score if generation.best else None
        if score is not None:
            best = score if best is None else max(best, score)
        curve.append(best)
    return tuple(curve)


def trained_share(history: History) -> float | None:
    """Slots whose training finished, over all slots. None before the first generation."""
    stats = by_generation(history)
    slots = sum(generation.slots for generation in stats)
    return sum(generation.trained for generation in stats) / slots if slots else None
