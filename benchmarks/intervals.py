"""A difference and the ends of its interval, in tables and in records."""

from __future__ import annotations

from openeureka.numbers import number
from openeureka.stats import Difference, Estimate


def interval(value: float, low: float, high: float, digits: int = 4) -> str:
    """For a table: `0.5 (0.1 to 0.9)`."""
    return f"{number(value, digits)} ({number(low, digits)} to {number(high, digits)})"


def interval_or_dash(found: Difference | Estimate | None, digits: int = 4) -> str:
    """For a table; a dash where there is no interval."""
    if found is None or found.low is None or found.high is None:
        return "-"
    return interval(found.value, found.low, found.high, digits)


def ends(found: Difference | None) -> list[float] | None:
    """For a record: the difference, and both ends."""
    return None if found is None else [found.value, found.low, found.high]
