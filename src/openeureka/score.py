"""Score arithmetic: how good a reward is, on a scale that tasks share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

from .stats import CONFIDENCE, Difference, Estimate, defined, difference, mean
from .types import COSTS, Evaluation, Limits, Peak, Place, Scored, TrainingResult, Word

ERRORS = 2.0
"""Standard errors that two scores must be apart before one counts as the higher."""


def human_normalised(method: float | None, human: float | None, sparse: float | None) -> float | None:
    """(method - sparse) / |human - sparse| of arXiv 2310.12931, section 4.2: 0 is as good as training on F itself, 1 as
    good as the human reward, or -1 where the human reward is the worse of the two. None when undefined."""
    if method is None or human is None or sparse is None or human == sparse:
        return None
    return (method - sparse) / abs(human - sparse)


def plainly_normalised(method: float | None, human: float | None, sparse: float | None) -> float | None:
    """The human-normalised score where no explanation fits: None unless the human reward beats the sparse one."""
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
    """One policy's score over all episodes of several looks, leaving out looks in which F was undefined.

    Args:
        shared: whether all looks use the same start states, as those of one policy in several worlds do
            (`report.robust`). Their errors are then added, as if fully correlated; those of independent looks add in
            squares. `played` pools looks with different start states. `lawful` and `tuned` pool trainings, and read
            only costs, which have no error.
    """
    counted = [look for look in looks if look.fitness is not None] or looks
    episodes = sum(look.episodes for look in counted)
    lost = sum(look.lost for look in looks)
    if not episodes:  # the mean would divide by zero
        return replace(looks[0], lost=lost)

    def total(values: Sequence[float | None]) -> float | None:
        """Mean over episodes."""
        known = [value for value in values if value is not None]
        weighted = (value * look.episodes for value, look in zip(known, counted, strict=False))
        return math.fsum(weighted) / episodes if len(known) == len(counted) else None

    errors = [(look.error or 0.0) * look.episodes for look in counted]
    summed = math.fsum(errors) if shared else math.hypot(*errors)
    return replace(
        looks[0],
        fitness=total([look.fitness for look in counted]),
        error=summed / episodes if counted[0].error is not None else None,
        episode_length=total([look.episode_length for look in counted]) or 0.0,
        episodes=episodes,
        lost=lost,
        costs={name: total([look.costs.get(name) for look in counted]) or 0.0 for name in looks[0].costs},
    )


def lawful(scores: Sequence[Evaluation], limits: Limits) -> bool:
    """Whether policies keep the limits on average over their episodes. No scores at all count as keeping them."""
    return not scores or not pooled(scores).broken(limits)


def excess(score: Evaluation, limits: Limits) -> float:
    """By how much a policy exceeds its limits, each excess as a share of its limit, summed."""
    return math.fsum((score.costs[name] - limits[name]) / (limits[name] or 1.0) for name in score.broken(limits))


def breach(score: Evaluation | None, limits: Limits) -> str:
    """The limits that a policy breaks, such as `torque 45.2 N m, above 40`; empty where it breaks none."""
    if score is None:
        return ""
    units = {name: f" {COSTS[name].unit}" if name in COSTS and COSTS[name].unit != "share" else "" for name in limits}
    return "; ".join(
        f"{name} {score.costs[name]:.3g}{units[name]}, above {limits[name]:g}" for name in score.broken(limits)
    )


def played(plays: Mapping[Peak, Sequence[Evaluation]], limits: Limits) -> Evaluation:
    """The score of a lane: that of its policy with the highest `worth`, the first of equals."""
    return max(map(pooled, plays.values()), key=lambda score: worth(score, limits))


def worth(score: Evaluation | None, limits: Limits) -> tuple[float, float]:
    """A key for max() over policies: the smaller `excess`, then the higher F. A policy without a score is last."""
    if score is None:
        return -math.inf, -math.inf
    return -excess(score, limits), rank(score.fitness)


def counted_peak(plays: Mapping[Peak, Sequence[Evaluation]] | None, otherwise: Peak, limits: Limits) -> Peak:
    """The checkpoint that counts for a lane: the one that plays best, or `otherwise` where none was played."""
    return (played(plays, limits).peak if plays else None) or otherwise


def level(scores: Mapping[str, Evaluation]) -> list[str]:
    """Names of those that may be the best: at most `ERRORS` standard errors below the highest, which is included."""
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
    """How much higher F of `own` is than F of `other`, over episodes; None where either is undefined.

    The interval is normal and takes both as independent. Where both play the same start states, their scores are
    correlated, and the interval is wider than need be.
    """
    if own.fitness is None or other.fitness is None:
        return None
    value, count = own.fitness - other.fitness, min(own.episodes, other.episodes)
    if own.error is None or other.error is None:
        return Estimate(value=value, low=None, high=None, count=count)
    half = NormalDist().inv_cdf((1 + CONFIDENCE) / 2) * math.hypot(own.error, other.error)
    return Estimate(value=value, low=value - half, high=value + half, count=count)


def learnt(rewards: Iterable[Sequence[float]], untrained: Sequence[float]) -> bool:
    """Whether policies of any reward are shown to be better than untrained ones, or too few seeds are known to say. All
    are held-out F, a value per seed."""
    gains = [difference(own, untrained) for own in rewards]
    return None in gains or any(gain is not None and gain.low > 0 for gain in gains)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedScores:
    """Scores of one reward's final trainings, one per seed; None for a seed without one, as after divergence."""

    training: tuple[float | None, ...] = ()
    """Maximum of F over the epochs, the measure of the published results."""
    held_out: tuple[float | None, ...] = ()
    """F of the chosen checkpoint in fresh episodes, without the optimism of a maximum."""

    @property
    def scores(self) -> tuple[float, ...]:
        """The defined held-out scores."""
        return tuple(defined(self.held_out))

    @staticmethod
    def of(
        lanes: Iterable[str], results: Mapping[str, TrainingResult], held_out: Mapping[str, Evaluation]
    ) -> SeedScores:
        """The scores of these lanes, by `results` and held-out scores that are both by lane id."""
        lanes = tuple(lanes)
        return SeedScores(
            training=tuple(results[lane].fitness for lane in lanes),
            held_out=tuple(held_out[lane].fitness if lane in held_out else None for lane in lanes),
        )


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
    untrained: tuple[float, ...] = ()
    """Held-out F of policies that never trained, a value per seed; older versions played at most one."""
    share: float = 1.0
    """Share of the race's error probability that belongs to the look at which it stopped: see `stats.spent`."""
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
        """Difference to the human reward in held-out F. The interval allows for the best having been picked among
        several, and for every look at which the race might have stopped."""
        rivals = [own.scores for own in self.rivals.values()]
        claims = (1 + len(rivals)) / self.share
        return difference(self.method.scores, self.human.scores, rivals, claims=claims)

    @property
    def same(self) -> bool:
        """Whether all seeds of both rewards have one and the same held-out score."""
        own, human = self.method, self.human
        return len({*own.held_out, *human.held_out}) == 1 and min(len(own.scores), len(human.scores)) > 1

    @property
    def word(self) -> Word:
        """The verdict in a word; empty where either reward has no held-out score."""
        if not (self.method.scores and self.human.scores):
            return ""
        found = self.difference
        if found is not None and found.sure:
            return "better" if found.value > 0 else "worse"
        if not learnt((self.method.scores, self.human.scores), self.untrained):
            return "nothing learnt"
        return "no difference" if self.same else "not decided"
