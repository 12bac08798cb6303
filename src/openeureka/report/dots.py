"""The scores that a verdict rests on as a dot plot: a row for each of the two rewards, a dot for each seed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..numbers import number
from ..stats import mean
from .charts import TOO_LARGE
from .view import RunView

CLOSE = 2.5
"""[% of the width] below which two dots would cover each other."""
TICKS = 4
"""About the number of ticks of the axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One reward's final trainings; positions are in % of the width."""

    name: str
    scores: tuple[float, ...]
    """F held out, of each seed."""
    mean: float
    seeds: tuple[tuple[float, int], ...]
    """Position of each dot, and how many dots stand above it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DotPlot:
    """The generated reward above the human one, on one axis of F."""

    word: str
    """What is decided."""
    rows: tuple[Row, Row]
    bar: tuple[float, float] | None
    """The 95 % interval of the difference, added to the human reward's mean; None with one seed of either."""
    ticks: tuple[tuple[float, str], ...]

    @property
    def most(self) -> int:
        """Most dots that stand above another one."""
        return max(level for row in self.rows for _, level in row.seeds)


def of(run: RunView) -> DotPlot | None:
    """The plot; None where the verdict compares no two scores.

    The bar is the interval that the verdict goes by: it allows for the number of rewards that were tried. Intervals of
    the two means would not, and they may overlap where the difference is sure.
    """
    ended = run.outcome
    if ended is None or not ended.word:
        return None
    both = {"generated": ended.method.scores, "human": ended.human.scores}
    means = {name: mean(scores) or 0.0 for name, scores in both.items()}
    found = ended.difference
    ends = (means["human"] + found.low, means["human"] + found.high) if found is not None else ()
    low, high = _span([*both["generated"], *both["human"], *ends])
    if not max(abs(low), abs(high)) < TOO_LARGE:
        return None

    def place(value: float) -> float:
        return round(100 * (value - low) / (high - low), 2)

    own, other = (
        Row(name=name, scores=scores, mean=place(means[name]), seeds=_apart([place(score) for score in scores]))
        for name, scores in both.items()
    )
    bar = (place(ends[0]), place(ends[1])) if ends else None
    ticks = tuple((place(value), number(value)) for value in _ticks(low, high))
    return DotPlot(word=ended.word, rows=(own, other), bar=bar, ticks=ticks)


def _span(values: Sequence[float]) -> tuple[float, float]:
    """Ends of the axis: a twentieth of it is left free at either end."""
    low, high = min(values), max(values)
    beyond = (high - low) / 18 or abs(low) / 10 or 1.0
    return low - beyond, high + beyond


def _apart(places: Sequence[float]) -> tuple[tuple[float, int], ...]:
    """Dots below each other where they would stand in one place."""
    stood: list[tuple[float, int]] = []
    for place in sorted(places):
        taken = {level for other, level in stood if place - other < CLOSE}
        stood.append((place, next(level for level in range(len(places)) if level not in taken)))
    return tuple(stood)


def _ticks(low: float, high: float) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten."""
    least = (high - low) / (TICKS + 1)
    power = 10.0 ** math.floor(math.log10(least))
    step = next(digit * power for digit in (1, 2, 5, 10) if digit * power >= least)
    return [count * step for count in range(math.ceil(low / step), math.floor(high / step) + 1)]
