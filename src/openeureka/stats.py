"""Statistics of plain numbers: means, ranks, correlations, confidence intervals and tests."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

CONFIDENCE = 0.95
MOST_SEEDS = 100
EARLY = 0.1
"""Share of a race's error probability that all looks before the last may use together."""
CLOSE = 1e-9
"""A spread below this share of the value is rounding."""
NEAR = 0.25
"""A share of successes this close to 0 or 1 counts as 0 or 1."""


def defined(values: Iterable[float | None]) -> list[float]:
    """The values that are finite numbers."""
    return [value for value in values if value is not None and math.isfinite(value)]


def mean(values: Iterable[float | None]) -> float | None:
    """Mean of the defined values; None when there is none."""
    known = defined(values)
    return math.fsum(known) / len(known) if known else None


def pearson(xs: Sequence[float | None], ys: Sequence[float | None]) -> float | None:
    """Pearson correlation over the pairs in which both are defined; None below two pairs or when either is constant."""
    pairs = [(x, y) for x, y in zip(xs, ys, strict=True) if x is not None and y is not None]
    pairs = [(x, y) for x, y in pairs if math.isfinite(x) and math.isfinite(y)]
    if len(pairs) < 2:
        return None
    mean_x = math.fsum(x for x, _ in pairs) / len(pairs)
    mean_y = math.fsum(y for _, y in pairs) / len(pairs)
    xy = math.fsum((x - mean_x) * (y - mean_y) for x, y in pairs)
    xx = math.fsum((x - mean_x) ** 2 for x, _ in pairs)
    yy = math.fsum((y - mean_y) ** 2 for _, y in pairs)
    if xx <= CLOSE**2 * math.fsum(x * x for x, _ in pairs) or yy <= CLOSE**2 * math.fsum(y * y for _, y in pairs):
        return None
    return xy / math.sqrt(xx * yy)


def midranks(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """Ranks from 1 to n; equal values share the mean of their ranks."""
    import numpy as np  # importing it takes a tenth of a second, and only screens and tunings rank

    _, places, counts = np.unique(np.asarray(values, np.float64), return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[places]


def spearman(xs: Sequence[float], ys: Sequence[float]) -> float | None:
    """Spearman's rank correlation; None below three pairs and where one side is constant."""
    return pearson(midranks(xs).tolist(), midranks(ys).tolist()) if len(xs) > 2 else None


def jackknife(without: Sequence[float]) -> float:
    """Standard error of a statistic, from its values without each unit in turn (Efron and Stein 1981)."""
    import numpy as np  # as in `midranks`

    return math.sqrt((len(without) - 1) * float(np.var(without)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How much higher F of one reward is than that of another, over training seeds."""

    value: float
    low: float
    high: float
    """Ends of the 95 % interval."""
    seeds: int | None
    """About as many seeds of each, in a comparison of these two alone, as would decide a difference of this size every
    other time; None above `MOST_SEEDS`."""

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt which is higher."""
        return self.low > 0 or self.high < 0


def difference(
    own: Sequence[float], other: Sequence[float], rivals: Iterable[Sequence[float]] = (), *, claims: float = 1
) -> Difference | None:
    """Student's interval of mean(own) - mean(other), one value per seed; None where either has fewer than two.

    The interval is the wider of two. One pools the spread of all rewards, as if they were equally noisy: two or three
    seeds may look steady by luck. The other uses the spreads of the two rewards alone: calm rivals must not make a
    noisy reward look steady. `benchmarks/verdicts.py` measures how often the interval errs.

    A reward that scores the same with every seed, as at F = 0, is left out of the pool, since it would make noisy
    rewards look steady. Compared with a noisy reward, it adds no noise. If both are such rewards, both join the pool,
    and the pool is their noise. All policies play the same start states, so the difference is free of what those have
    in common.

    Where the two rewards take only two values, as where F is 0 or 1, a spread does not measure chance. The same holds
    where each value is near 0 or near 1: trainings that succeed or do not. There the interval includes zero unless
    Fisher's exact test is sure as well.

    Args:
        rivals: scores of the other rewards in the race, for the spread.
        claims: how many such intervals are to hold together (Bonferroni), as where the best of several is compared.
    """
    if len(own) < 2 or len(other) < 2:
        return None
    noisy = [values for values in (own, other) if len({*values}) > 1] or [own, other]
    among = [*noisy, *(values for values in rivals if len({*values}) > 1)]
    (spread, freedom), alone = pooled(among), sum(len(values) - 1 for values in noisy)
    value = math.fsum(own) / len(own) - math.fsum(other) / len(other)
    half = max(
        quantile(freedom, claims) * spread * math.sqrt(sum(1 / len(values) for values in noisy)),
        quantile(alone, claims) * math.sqrt(sum(_variance(values) / len(values) for values in noisy)),
    )
    rates = _rates(own, other)
    if rates is not None and claims * _exact(rates, len(own), len(other)) > 1 - CONFIDENCE:
        half = max(half, abs(value))
    largest = math.sqrt(max(len(noisy) * spread**2, sum(map(_variance, noisy))))
    enough = (
        n
        for n in range(2, MOST_SEEDS + 1)
        if quantile(len(noisy) * (n - 1)) * largest / math.sqrt(n) < abs(value)
        and (rates is None or _exact(rates, n, n) <= 1 - CONFIDENCE)
    )
    return Difference(value=value, low=value - half, high=value + half, seeds=next(enough, None))


def pooled(groups: Sequence[Sequence[float]]) -> tuple[float, int]:
    """Standard deviation within groups, as if all were equally noisy, and its degrees of freedom.

    Args:
        groups: none is empty, and at least one has two values.
    """
    freedom = sum(len(values) - 1 for values in groups)
    squares = math.fsum(_variance(values) * (len(values) - 1) for values in groups if len(values) > 1)
    return math.sqrt(squares / freedom), freedom


def _variance(values: Sequence[float]) -> float:
    centre = math.fsum(values) / len(values)
    return math.fsum((x - centre) ** 2 for x in values) / (len(values) - 1)


def two_valued(values: Sequence[float]) -> bool:
    """Whether there are at most two values, or all are near 0 or 1, some at each: trainings that succeed or do not."""
    low, high, near = min(values), max(values), _near(values)
    return all(min(x - low, high - x) <= near for x in values)


def _near(values: Sequence[float]) -> float:
    """How far a value may lie from the least or the largest and still count as it."""
    low, high = min(values), max(values)
    ends = low < NEAR < 1 - NEAR < high and all(0 <= min(x, 1 - x) <= NEAR for x in values)
    return NEAR if ends else CLOSE * max(abs(low), abs(high))


def _rates(own: Sequence[float], other: Sequence[float]) -> tuple[float, float] | None:
    """How often each reward has the higher of two values, or of two groups of values; None where there are more."""
    both = (*own, *other)
    if not two_valued(both):
        return None
    high, near = max(both), _near(both)
    one, two = (sum(high - x <= near for x in values) / len(values) for values in (own, other))
    return one, two


def _exact(rates: tuple[float, float], own: int, other: int) -> float:
    """Fisher's exact test, two-sided: the probability that chance deals two values at least as unevenly."""
    one, two = round(rates[0] * own), round(rates[1] * other)
    ways = [math.comb(own, k) * math.comb(other, one + two - k) for k in range(min(own, one + two) + 1)]
    return sum(way for way in ways if way <= ways[one]) / sum(ways)


def spent(trained: int, seeds: int, first: int) -> float:
    """Share of a race's error probability that its look after `trained` seeds may use.

    Every look is another chance to err. Early looks must be nearly certain, so that the last look, which most races
    reach, is hardly stricter than a single test (Haybittle 1971, Peto et al. 1976; the shares add up as Bonferroni's
    do).

    Args:
        trained: seeds of each reward so far.
        seeds: the most there may be.
        first: seeds at the first look.
    """
    early = seeds - first
    if early < 1:
        return 1.0
    return EARLY / early if trained < seeds else 1.0 - EARLY


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A mean over independent values, such as those of several searches or episodes."""

    value: float
    low: float | None
    high: float | None
    """Ends of the 95 % interval; None for a single value, which has no spread."""
    count: int
    claims: int = 1
    """How many such intervals are to hold together."""

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt on which side of zero it is. Equal values, which have no spread, do so
        once chance is unlikely to give that many the same sign."""
        if self.low is None or self.high is None or self.low <= 0 <= self.high:
            return False
        return self.low < self.high or self.claims * 2.0 ** (1 - self.count) <= 1 - CONFIDENCE


def estimate(values: Sequence[float | None], *, claims: int = 1) -> Estimate | None:
    """Student's interval of the mean of the defined values; None where there is none.

    Args:
        claims: how many such intervals are to hold together, as in `difference`.
    """
    known = defined(values)
    centre, count = mean(known), len(known)
    if centre is None:
        return None
    if count < 2:
        return Estimate(value=centre, low=None, high=None, count=count, claims=claims)
    spread, freedom = pooled([known])
    half = quantile(freedom, claims) * spread / math.sqrt(count) if spread > CLOSE * abs(centre) else 0.0
    return Estimate(value=centre, low=centre - half, high=centre + half, count=count, claims=claims)


def quantile(freedom: float, claims: float = 1) -> float:
    """Half width of a 95 % interval in standard errors (Student's t), where `claims` intervals are to hold together."""
    from scipy.special import stdtrit  # pyright: ignore[reportMissingTypeStubs] # a third of a second that only the end of a search needs

    return float(stdtrit(freedom, 1 - (1 - CONFIDENCE) / (2 * max(1, claims))))
