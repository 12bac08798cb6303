"""The family tree of a search as data for a picture: which candidate improves on which, a column a generation."""

from __future__ import annotations

from dataclasses import dataclass

from ..types import Place
from .candidates import CandidateView
from .charts import drawable
from .view import RunView

SHADES = 9
"""Colours of the scale of F, from the lowest to the highest."""
COLUMN, ROW, MARGIN, HEAD = 120.0, 22.0, 16.0, 22.0
"""[px] of the tree."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A candidate in the family tree, in pixels."""

    place: Place
    x: float
    y: float
    score: float | None
    """F."""
    shade: int | None
    """0 to SHADES - 1, from the lowest F to the highest; None without one."""
    parent: tuple[float, float] | None
    """Position of the candidate that it improves on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """The family tree: which candidate improves on which, with a column for each generation."""

    members: tuple[Member, ...]
    heads: tuple[tuple[float, str], ...]
    """Position and name of each column."""
    width: float
    height: float
    low: float | None
    high: float | None
    """F of the lowest and the highest shade."""


def of(run: RunView) -> Family | None:
    """The family tree; None where nobody has a parent yet."""
    if not any(candidate.parent for candidate in run.candidates):
        return None
    scores = [score for candidate in run.candidates if (score := drawable(candidate.score)) is not None]
    low, high = (min(scores), max(scores)) if scores else (None, None)
    at: dict[Place, tuple[float, float]] = {}
    members: list[Member] = []

    def parent(candidate: CandidateView) -> tuple[float, float] | None:
        return at.get(candidate.parent.place) if candidate.parent is not None else None

    for column, generation in enumerate(run.generations):
        # Children stand in the order of their parents, so that few lines cross.
        ordered = sorted(generation.candidates, key=lambda candidate: (parent(candidate) or (0.0, 0.0))[1])
        for row, candidate in enumerate(ordered):
            x, y = MARGIN + column * COLUMN, HEAD + MARGIN + row * ROW
            at[candidate.place] = x, y
            members.append(
                Member(
                    place=candidate.place,
                    x=x,
                    y=y,
                    score=candidate.score,
                    shade=_shade(candidate.score, low, high),
                    parent=parent(candidate),
                )
            )
    tallest = max(len(generation.candidates) for generation in run.generations)
    return Family(
        members=tuple(members),
        heads=tuple(
            (MARGIN - 7 + column * COLUMN, f"generation {g.index}") for column, g in enumerate(run.generations)
        ),
        width=2 * MARGIN + (len(run.generations) - 1) * COLUMN + 60,
        height=HEAD + 2 * MARGIN + (tallest - 1) * ROW,
        low=low,
        high=high,
    )


def _shade(score: float | None, low: float | None, high: float | None) -> int | None:
    score = drawable(score)
    if score is None or low is None or high is None:
        return None
    return round((score - low) / (high - low) * (SHADES - 1)) if high > low else SHADES - 1
