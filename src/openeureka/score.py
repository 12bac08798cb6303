"""Score arithmetic: how good a reward is, on a scale that tasks share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .types import Evaluation, Scored, TrainingResult


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
    return xy / math.sqrt(xx * yy) if xx > 0 and yy > 0 else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One reward's final trainings, a value per seed; None where that seed diverged."""

    training: tuple[float | None, ...] = ()
    """Maximum of F over the epochs, the measure of the published results."""
    held_out: tuple[float | None, ...] = ()
    """F of the chosen checkpoint in fresh episodes, without the optimism of a maximum."""


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
    """The winner of the search; None when no program ever trained."""
    method: Arm = Arm()
    human: Arm = Arm()
    sparse: Arm = Arm()
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


def compare(
    best: Scored,
    lanes: Mapping[str, Sequence[str]],
    results: Mapping[str, TrainingResult],
    scores: Mapping[str, Evaluation],
    known: Baselines | None = None,
) -> Outcome:
    """The outcome of the final trainings.

    Args:
        lanes: job ids of `method`, `human` and `sparse`, a seed each; one that is missing, because the run is not that
            far, counts as undefined.
        known: `human` and `sparse` where the run has no lanes of them.
    """

    fitness = {job: result.fitness for job, result in results.items()}
    held_out = {job: score.fitness for job, score in scores.items()}

    def arm(name: str) -> Arm:
        return Arm(training=tuple(map(fitness.get, lanes[name])), held_out=tuple(map(held_out.get, lanes[name])))

    trained = [results[job] for job in lanes["method"] if job in results]
    curves = [(result.curves.get("reward", ()), result.curves.get("human_reward", ())) for result in trained]
    return Outcome(
        best=best,
        method=arm("method"),
        human=known.human if known else arm("human"),
        sparse=known.sparse if known else arm("sparse"),
        correlation=mean([result.correlation for result in trained]),
        curve_correlation=mean([pearson(own, human) for own, human in curves]),
    )
