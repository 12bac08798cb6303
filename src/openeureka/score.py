"""Score arithmetic: how good a reward is, on a scale that tasks share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist
from typing import TYPE_CHECKING

from .types import COSTS, Evaluation, Limits, Peak, Place, Scored, TrainingResult

if TYPE_CHECKING:
    import numpy as np

ERRORS = 2.0
"""Standard errors that two scores must be apart before one counts as the higher."""


NO_LIMITS: Limits = {}


def mean(values: Sequence[float | None]) -> float | None:
    """Mean of the defined values; None when there is none."""
    defined = [value for value in values if value is not None and math.isfinite(value)]
    return math.fsum(defined) / len(defined) if defined else None


def human_normalised(method: float | None, human: float | None, sparse: float | None) -> float | None:
    """(method - sparse) / |human - sparse| of arXiv 2310.12931, section 4.2: 0 is as good as training on F itself, 1 as
    good as the reward that people wrote. None when undefined."""
    if method is None or human is None or sparse is None or human == sparse:
        return None
    return (method - sparse) / abs(human - sparse)


def clipped(normalised: float | None) -> float | None:
    """Clipped to [0, 3], as the paper does before it averages over tasks (appendix D)."""
    return min(max(normalised, 0.0), 3.0) if normalised is not None else None


def rank(fitness: float | None) -> float:
    """A key for max(): undefined F never wins, and neither does NaN."""
    return fitness if fitness is not None and math.isfinite(fitness) else -math.inf


def pooled(looks: Sequence[Evaluation], *, shared: bool = False) -> Evaluation:
    """One policy's score over all episodes that it played in several looks, where F was defined in them.

    Args:
        shared: whether all play the same start states, as one policy does in several worlds (`report.robust`). Their
            errors then add up, as if all went wrong together; of independent ones the squares do. `played` pools looks
            on start states of their own. `lawful` and `tuned` pool trainings, and read costs alone, which have no
            error.
    """
    defined = [look for look in looks if look.fitness is not None] or looks
    episodes = sum(look.episodes for look in defined)

    def total(values: Sequence[float | None]) -> float | None:
        """Mean over episodes."""
        known = [value for value in values if value is not None]
        weighted = (value * look.episodes for value, look in zip(known, defined, strict=False))
        return math.fsum(weighted) / episodes if len(known) == len(defined) else None

    errors = [(look.error or 0.0) * look.episodes for look in defined]
    summed = math.fsum(errors) if shared else math.hypot(*errors)
    return replace(
        looks[0],
        fitness=total([look.fitness for look in defined]),
        error=summed / episodes if defined[0].error is not None else None,
        episode_length=total([look.episode_length for look in defined]) or 0.0,
        episodes=episodes,
        costs={name: total([look.costs.get(name) for look in defined]) or 0.0 for name in looks[0].costs},
    )


def lawful(scores: Sequence[Evaluation], limits: Limits) -> bool:
    """Whether policies keep the limits on average over their episodes; those of which nothing is known do."""
    return not scores or not pooled(scores).broken(limits)


def excess(score: Evaluation, limits: Limits) -> float:
    """By how much a policy is beyond its limits: shares of them, in all."""
    return math.fsum((score.costs[name] - limits[name]) / (limits[name] or 1.0) for name in score.broken(limits))


def breach(score: Evaluation | None, limits: Limits) -> str:
    """`torque 45.2 N m, above 40`: what a policy breaks; empty where nothing."""
    if score is None:
        return ""
    units = {name: f" {COSTS[name].unit}" if name in COSTS and COSTS[name].unit != "share" else "" for name in limits}
    return "; ".join(
        f"{name} {score.costs[name]:.3g}{units[name]}, above {limits[name]:g}" for name in score.broken(limits)
    )


def played(plays: Mapping[Peak, Sequence[Evaluation]], limits: Limits = NO_LIMITS) -> Evaluation:
    """What a lane scores: that of its policies which plays best counts, one that keeps the limits before others; of
    equals the first."""
    return max(map(pooled, plays.values()), key=lambda score: worth(score, limits))


def worth(score: Evaluation | None, limits: Limits = NO_LIMITS) -> tuple[bool, float]:
    """To rank policies by: one that keeps the limits comes before others, then F counts. Of one without a score nothing
    is known."""
    return score is not None and not score.broken(limits), rank(score.fitness if score is not None else None)


def standing(plays: Mapping[Peak, Sequence[Evaluation]] | None, otherwise: Peak, limits: Limits = NO_LIMITS) -> Peak:
    """Which of its policies stands for a lane: that which plays best, or another where none was played."""
    return (played(plays, limits).peak if plays else None) or otherwise


def level(scores: Mapping[str, Evaluation]) -> list[str]:
    """Who may be the best as far as the errors tell: less than two of them below the highest, that one included."""
    best = max(scores.values(), key=lambda score: rank(score.fitness), default=None)
    if best is None or best.fitness is None:
        return []
    return [
        name
        for name, score in scores.items()
        if score.fitness is not None
        and best.fitness - score.fitness <= ERRORS * math.hypot(best.error or 0.0, score.error or 0.0)
    ]


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
    """Ranks from 1 to n; equal values share the mean of theirs. Spearman's correlation is `pearson` of these."""
    import numpy as np  # takes a tenth of a second, and only screens and tunings rank

    _, places, counts = np.unique(np.asarray(values, np.float64), return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[places]


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How much higher F of one reward is than that of another, over training seeds."""

    value: float
    low: float
    high: float
    """Ends of the 95 % interval."""
    seeds: int | None
    """Of each of the two alone, about as many as would decide a difference of this size every other time; None beyond
    `MOST_SEEDS`."""

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt which is higher."""
        return self.low > 0 or self.high < 0


CONFIDENCE = 0.95
MOST_SEEDS = 100
CLOSE = 1e-9
"""A spread below this share of the value is rounding."""


def difference(
    own: Sequence[float], other: Sequence[float], rivals: Iterable[Sequence[float]] = (), *, claims: float = 1
) -> Difference | None:
    """Student's interval of mean(own) - mean(other), a value a seed; None where either has fewer than two.

    With two or three seeds each a spread of its own is worth little: that of all rewards is pooled, as if they were
    equally noisy. All play the same start states, so what those share is no part of it.

    Where the two rewards have but two values, as where F is 0 or 1, no spread tells what chance does. Then the interval
    ends at zero at the least, until Fisher's exact test is sure as well.

    Args:
        rivals: scores of the others in the race, for the spread. Those that score the same with every seed tell nothing
            of it: they would make two noisy rewards look steady.
        claims: how many such intervals are to hold together (Bonferroni), as where the best of several is compared.
    """
    if len(own) < 2 or len(other) < 2:
        return None
    among = [own, other, *(values for values in rivals if len({*values}) > 1)]
    freedom = sum(len(values) - 1 for values in among)
    squares = [(x - math.fsum(values) / len(values)) ** 2 for values in among for x in values]
    spread = math.sqrt(math.fsum(squares) / freedom)
    value = math.fsum(own) / len(own) - math.fsum(other) / len(other)
    half = _quantile(freedom, claims) * spread * math.sqrt(1 / len(own) + 1 / len(other))
    rates = _rates(own, other)
    if rates is not None and claims * _exact(rates, len(own), len(other)) > 1 - CONFIDENCE:
        half = max(half, abs(value))
    enough = (
        n
        for n in range(2, MOST_SEEDS + 1)
        if _quantile(2 * n - 2) * spread * (2 / n) ** 0.5 < abs(value)
        and (rates is None or _exact(rates, n, n) <= 1 - CONFIDENCE)
    )
    return Difference(value=value, low=value - half, high=value + half, seeds=next(enough, None))


def _rates(own: Sequence[float], other: Sequence[float]) -> tuple[float, float] | None:
    """How often each has the higher of two values; None where there are more values than two."""
    low, high = min(*own, *other), max(*own, *other)
    rounding = CLOSE * max(abs(low), abs(high))
    if any(min(x - low, high - x) > rounding for x in (*own, *other)):
        return None
    one, two = (sum(high - x <= rounding for x in values) / len(values) for values in (own, other))
    return one, two


def _exact(rates: tuple[float, float], own: int, other: int) -> float:
    """Fisher's exact test, of two sides: how likely chance alone deals two values as unevenly, or more."""
    one, two = round(rates[0] * own), round(rates[1] * other)
    ways = [math.comb(own, k) * math.comb(other, one + two - k) for k in range(min(own, one + two) + 1)]
    return sum(way for way in ways if way <= ways[one]) / sum(ways)


EARLY = 0.1
"""Of all errors, the share that the looks before the last may make together."""


def spent(trained: int, seeds: int, first: int) -> float:
    """Of the errors that a race may make in all, the share of its look after so many seeds.

    To look again is to try again. Those who stop early must be nearly certain, so that the last look, which most races
    come to, is hardly stricter than one alone (Haybittle 1971, Peto et al. 1976; the shares add up as Bonferroni's do).

    Args:
        trained: seeds of each reward so far.
        seeds: the most there may be.
        first: seeds of the first look.
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
    """Ends of the 95 % interval; None where one value has no spread."""
    count: int
    claims: int = 1
    """How many such intervals are to hold together."""

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt on which side of zero it is. Values without a spread do as soon as so
        many of one sign are no chance."""
        if self.low is None or self.high is None or self.low <= 0 <= self.high:
            return False
        return self.low < self.high or self.claims * 2.0 ** (1 - self.count) <= 1 - CONFIDENCE


def estimate(values: Sequence[float | None], *, claims: int = 1) -> Estimate | None:
    """Student's interval of the mean of the defined values; None where there is none.

    Args:
        claims: how many such intervals are to hold together, as in `difference`.
    """
    defined = [value for value in values if value is not None and math.isfinite(value)]
    centre, count = mean(defined), len(defined)
    if centre is None:
        return None
    if count < 2:
        return Estimate(value=centre, low=None, high=None, count=count, claims=claims)
    spread = math.sqrt(math.fsum((value - centre) ** 2 for value in defined) / (count - 1))
    half = _quantile(count - 1, claims) * spread / math.sqrt(count) if spread > CLOSE * abs(centre) else 0.0
    return Estimate(value=centre, low=centre - half, high=centre + half, count=count, claims=claims)


def gain(own: Evaluation, other: Evaluation) -> Estimate | None:
    """How much higher F of one policy is than that of another, over episodes; None where either is undefined.

    The interval is normal and takes both as independent. Where they play the same start states, what those share makes
    it wider than need be.
    """
    if own.fitness is None or other.fitness is None:
        return None
    value, count = own.fitness - other.fitness, min(own.episodes, other.episodes)
    if own.error is None or other.error is None:
        return Estimate(value=value, low=None, high=None, count=count)
    half = NormalDist().inv_cdf((1 + CONFIDENCE) / 2) * math.hypot(own.error, other.error)
    return Estimate(value=value, low=value - half, high=value + half, count=count)


def _quantile(freedom: int, claims: float = 1) -> float:
    from scipy.special import stdtrit  # pyright: ignore[reportMissingTypeStubs] # a third of a second that only the end of a search needs

    return float(stdtrit(freedom, 1 - (1 - CONFIDENCE) / (2 * max(1, claims))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One reward's final trainings, a value per seed; None where that seed has none, as where it diverged at once."""

    training: tuple[float | None, ...] = ()
    """Maximum of F over the epochs, the measure of the published results."""
    held_out: tuple[float | None, ...] = ()
    """F of the chosen checkpoint in fresh episodes, without the optimism of a maximum."""

    @property
    def scores(self) -> tuple[float, ...]:
        """The defined held-out scores."""
        return tuple(value for value in self.held_out if value is not None and math.isfinite(value))


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Both ends of the scale for one task, measured beforehand."""

    human: Arm
    sparse: Arm
    env_steps: int
    worlds: int
    device: str
    date: str

    def sentence(self) -> str:
        """How the numbers came about."""
        seeds = len(self.human.training)
        size = f"{self.env_steps:,} steps in {self.worlds} worlds, {seeds} seed{'s' if seeds != 1 else ''}"
        return f"The human and the sparse reward were measured beforehand: {size}, on {self.device}, {self.date}."


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a search found, and how it compares with the rewards that people wrote."""

    best: Scored | None
    """The confirmed winner; None when no program ever trained, or each breaks a limit."""
    method: Arm = Arm()
    human: Arm = Arm()
    sparse: Arm = Arm()
    rivals: Mapping[Place, Arm] = field(default_factory=dict[Place, Arm])
    """The other rewards that the best was confirmed against."""
    share: float = 1.0
    """Of all errors, those that the look at which the race stopped may make: see `spent`."""
    correlation: float | None = None
    """Pearson correlation of the best reward with the human reward over transitions, mean over seeds."""
    curve_correlation: float | None = None
    """The same over the means of epochs, as the published code computes it; mean over seeds."""

    @property
    def normalised(self) -> float | None:
        """Human-normalised score on held-out episodes."""
        return human_normalised(mean(self.method.held_out), mean(self.human.held_out), mean(self.sparse.held_out))

    @property
    def normalised_training(self) -> float | None:
        """Human-normalised score as published, on maxima over training."""
        return human_normalised(mean(self.method.training), mean(self.human.training), mean(self.sparse.training))

    @property
    def difference(self) -> Difference | None:
        """To the human reward, held out. It allows for the best having been picked among several, and for every look
        at which the race might have stopped."""
        rivals = [arm.scores for arm in self.rivals.values()]
        claims = (1 + len(rivals)) / self.share
        return difference(self.method.scores, self.human.scores, rivals, claims=claims)


def compare(
    best: Scored,
    lanes: Mapping[str, Sequence[str]],
    results: Mapping[str, TrainingResult],
    scores: Mapping[str, Evaluation],
    known: Baselines | None = None,
    rivals: Sequence[Scored] = (),
    share: float = 1.0,
) -> Outcome:
    """The outcome of the final trainings.

    Args:
        lanes: lane ids by reward (candidate id, `human` or `sparse`), a seed each; one that is missing, because the run
            is not that far, counts as undefined.
        known: `human` and `sparse` where the run has no lanes of them.
        rivals: the other candidates that trained again.
        share: see `Outcome`.
    """
    fitness = {lane: result.fitness for lane, result in results.items()}
    held_out = {lane: score.fitness for lane, score in scores.items()}

    def arm(name: str) -> Arm:
        return Arm(training=tuple(map(fitness.get, lanes[name])), held_out=tuple(map(held_out.get, lanes[name])))

    own = best.sample.verdict.candidate
    trained = [results[lane] for lane in lanes[own] if lane in results]
    curves = [(result.curves.get("reward", ()), result.curves.get("human_reward", ())) for result in trained]
    return Outcome(
        best=best,
        method=arm(own),
        human=known.human if known else arm("human"),
        sparse=known.sparse if known else arm("sparse"),
        rivals={rival.sample.place: arm(rival.sample.verdict.candidate) for rival in rivals},
        share=share,
        correlation=mean([result.correlation for result in trained]),
        curve_correlation=mean([pearson(own, human) for own, human in curves]),
    )
