"""Numbers, durations and tables as text."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

from .types import Evaluation

LARGE = 1e6
"""From this size on, numbers are written with an exponent."""
BLOCKS = "▁▂▃▄▅▆▇█"


def number(value: float | None, digits: int = 4) -> str:
    """A score for a table; a dash where there is none."""
    if value is None:
        return "-"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < LARGE else text


def scored(score: Evaluation | None) -> str:
    """What a policy scored, with its standard error over episodes."""
    if score is None or score.error is None:
        return number(score.fitness if score is not None else None)
    return within(score.fitness, score.error)


def within(value: float | None, error: float) -> str:
    """A value and its error: the error has two significant digits, and the value ends at the same decimal place."""
    told = number(error, 2)
    if value is None or not error or not math.isfinite(value) or "e" in told or abs(value) >= LARGE:
        return f"{number(value)} ± {told}"
    places = max(0, 1 - math.floor(math.log10(abs(float(told)))))
    return f"{value:.{places}f} ± {error:.{places}f}"


def spread(values: Sequence[float | None]) -> str:
    """Mean of the defined values and, for several, their sample standard deviation; says how many are undefined."""
    defined = [value for value in values if value is not None]
    if not defined:
        return "-"
    missing = f" ({len(values) - len(defined)} undefined)" if len(defined) < len(values) else ""
    middle = statistics.fmean(defined)
    told = within(middle, statistics.stdev(defined)) if len(defined) > 1 else number(middle)
    return f"{told}{missing}"


def sparkline(values: Sequence[float | None], width: int) -> str:
    """A curve in at most `width` characters, scaled from its least to its largest value: a space where it is undefined,
    `-` if it is undefined throughout."""
    every = max(1, -(-len(values) // width))
    kept = values[::-1][::every][::-1]  # keeps the newest value
    defined = [value for value in kept if value is not None]
    if not defined:
        return "-"
    low, step = min(defined), (max(defined) - min(defined)) / (len(BLOCKS) - 1) or 1.0
    return "".join(" " if value is None else BLOCKS[round((value - low) / step)] for value in kept)


def dollars(cost: float) -> str:
    """An amount of US$, to the cent from one dollar on."""
    if not cost:
        return "0"
    return f"{cost:,.2f}" if cost >= 1 else f"{cost:.4f}"


def duration(seconds: float) -> str:
    """`42 s`, `3 min 05 s` or `2 h 10 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Rows of cells as aligned text; the last column is not padded."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths[-1] = 0
    return "\n".join("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows)
