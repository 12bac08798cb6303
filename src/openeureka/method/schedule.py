"""How long candidates train: all to the end, or fewer and fewer, by how their policies play on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..score import NO_LIMITS, excess, rank
from ..types import Evaluation, Limits


@dataclass(frozen=True, slots=True)
class Rung:
    """Where the candidates of a generation pause, and some of them go on."""

    share: float
    """Of the steps of a training."""
    kept: float
    """Of the candidates that came so far; one at least."""


WHOLE = Rung(share=1.0, kept=1.0)
"""The end of a training."""
RUNGS: Mapping[str, tuple[Rung, ...]] = {
    "full": (),
    "halving": (Rung(1 / 8, 1 / 2), Rung(1 / 4, 1 / 2), Rung(1 / 2, 1 / 2)),
}
"""By the setting `schedule`."""


def leaders(scores: Mapping[str, Evaluation], rung: Rung, limits: Limits = NO_LIMITS) -> frozenset[str]:
    """The lanes that go on: those that play best, of equals the earlier one. One beyond a limit comes after all that
    keep them."""
    ordered = sorted(scores, key=lambda lane: _worth(scores[lane], limits), reverse=True)
    return frozenset(ordered[: max(1, math.ceil(rung.kept * len(ordered)))])


def why(rung: Rung, lane: str, scores: Mapping[str, Evaluation], limits: Limits = NO_LIMITS) -> str:
    """Why a lane was cut, for people."""
    own = _worth(scores[lane], limits)
    place = sum(_worth(score, limits) > own for score in scores.values()) + 1
    return f"after {rung.share:.3g} of its steps, at place {place} of {len(scores)}"


def _worth(score: Evaluation, limits: Limits) -> tuple[float, float]:
    return -excess(score, limits), rank(score.fitness)
