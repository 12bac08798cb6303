"""Score arithmetic: how good a reward is, on a scale that tasks share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

from .stats import CONFIDENCE, Difference, Estimate, difference, mean
from .types import COSTS, Evaluation, Limits, Peak, Place, Scored, Word

ERRORS = 2.0
"""Standard errors that two scores must be apart before one counts as the higher."""


def human_normalised(method: float | None, human: float | None, sparse: float | None) -> float | None:
    """(method - sparse) / |human - sparse| of arXiv 2310.12931, section 4.2: 0 is as good as training on F itself, 1 as
    good as the reward that people wrote, or -1 where that is the worse of the two. None when undefined."""
    if method is None or human is None or sparse is None or human == sparse:
        return None
    return (method - sparse) / abs(human - sparse)


def plainly_normalised(method: float | None, human: float | None, sparse: float | None) -> float | None:
    """The human-normalised score where no room is to say how to read it: None where its 0 is no worse than its 1."""
    if human is None or sparse is None or human <= sparse:
        return None
    return human_normalised(method, human, sparse)


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
    lost = sum(look.lost for look in looks)
    if not episodes:  # to take a mean over
        return replace(looks[0], lost=lost)

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
        lost=lost,
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


def played(plays: Mapping[Peak, Sequence[Evaluation]], limits: Limits) -> Evaluation:
    """What a lane scores: that of its policies which is worth most counts, of equals the first."""
    return max(map(pooled, plays.values()), key=lambda score: worth(score, limits))


def worth(score: Evaluation | None, limits: Limits) -> tuple[float, float]:
    """To rank policies by: the less one is beyond the limits the better, then F counts. One without a score is last."""
    if score is None:
        return -math.inf, -math.inf
    return -excess(score, limits), rank(score.fitness)


def counted_peak(plays: Mapping[Peak, Sequence[Evaluation]] | None, otherwise: Peak, limits: Limits) -> Peak:
    """Which of its policies counts for a lane: that which plays best, or another where none was played."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedScores:
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
class Outcome:
    """What a search found, and how it compares with the rewards that people wrote."""

    best: Scored | None
    """The confirmed winner; None when no program ever trained, or each breaks a limit."""
    method: SeedScores = SeedScores()
    human: SeedScores = SeedScores()
    sparse: SeedScores = SeedScores()
    rivals: Mapping[Place, SeedScores] = field(default_factory=dict[Place, SeedScores])
    """The other rewards that the best was confirmed against."""
    share: float = 1.0
    """Of all errors, those that the look at which the race stopped may make: see `stats.spent`."""
    correlation: float | None = None
    """Pearson correlation of the best reward with the human reward over transitions, mean over seeds."""
    curve_correlation: float | None = None
    """The same over the means of epochs, as the published code computes it; mean over seeds."""

    @property
    def normalised(self) -> float | None:
        """Human-normalised score on held-out episodes."""
        return human_normalised(mean(self.method.held_out), mean(self.human.held_out), mean(self.sparse.held_out))

    @property
    def difference(self) -> Difference | None:
        """To the human reward, held out. It allows for the best having been picked among several, and for every look
        at which the race might have stopped."""
        rivals = [own.scores for own in self.rivals.values()]
        claims = (1 + len(rivals)) / self.share
        return difference(self.method.scores, self.human.scores, rivals, claims=claims)

    @property
    def same(self) -> bool:
        """Whether both rewards have one and the same score with every seed."""
        own, human = self.method, self.human
        return len({*own.held_out, *human.held_out}) == 1 and min(len(own.scores), len(human.scores)) > 1

    @property
    def word(self) -> Word:
        """What is decided between both."""
        if not (self.method.scores and self.human.scores):
            return ""
        found = self.difference
        if found is None or not found.sure:
            return "no difference" if self.same else "not decided"
        return "better" if found.value > 0 else "worse"
