"""What the tuning of a reward found: numbers before and after, which of them matter, and how F changed."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

from ..config import FEWEST_TUNED, NO_MODEL, RunConfig
from ..method import race
from ..method.seeds import tuning_seeds
from ..reward.weights import Weight, values, weights
from ..score import SeedScores, breach, lawful, pooled, rank
from ..stats import CONFIDENCE, Difference, difference, mean, spearman
from ..types import COMPONENT, Candidate, Evaluation, Limits, TrainingResult, TrainingState, lane_id, of_components

ORIGINAL = "original"
"""Name of the original text; the others are `trial_1` and so on."""
FEWEST = 5
"""Fewest trainings for a correlation to have an interval."""
LAST = 0.1
"""Share of the epochs that the mean of a component is taken over."""

Texts = Mapping[str, Candidate]
"""Every weighting by name, the original text first."""
Scores = Mapping[str, Evaluation]
"""Scores by lane id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Spearman's rank correlation with its interval."""

    value: float
    low: float
    high: float

    @property
    def sure(self) -> bool:
        """Whether the interval leaves no doubt of its sign."""
        return self.low > 0 or self.high < 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """What one number did to played F, over all trainings of the rounds."""

    weight: Weight
    """The number in the original text."""
    after: float | None
    """The number in the best other weighting; None before there is one."""
    trend: Correlation | None
    """Correlation of F with the number and its sign; None where there are too few trainings."""
    distance: Correlation | None
    """Correlation of F with how far the number is from the original one, up or down."""

    @property
    def matters(self) -> bool:
        """Whether either correlation is beyond doubt."""
        return any(found is not None and found.sure for found in (self.trend, self.distance))


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighting:
    """A reward text with one set of numbers, and its results so far."""

    name: str
    candidate: Candidate
    values: tuple[float, ...]
    result: TrainingResult | None
    """Result of its training with the run's seed; None before that is over."""
    played: float | None
    """Played F of that training's policy; None where the training was cut, as it was shorter than the others."""

    @property
    def cut(self) -> bool:
        """Whether the search cut its training: the original text may have won a search although it was cut."""
        return self.result is not None and self.result.state is TrainingState.CUT


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """A tuning, as far as it has come."""

    trials: tuple[Weighting, ...]
    trained: int
    """Number of them that have trained so far."""
    effects: tuple[Effect, ...]
    after: str
    """Name of the weighting, other than the original, that the final trainings prefer; empty before there is one."""
    finals: Mapping[str, SeedScores] = field(default_factory=dict[str, SeedScores])
    """Scores of the final trainings by name, one per fresh seed, for the original text and those that raced it."""
    components: Mapping[str, tuple[float | None, float | None]] = field(
        default_factory=dict[str, tuple[float | None, float | None]]
    )
    """Mean of each component at the end of the final trainings, before and after tuning."""
    judged: bool = False
    """Whether the final trainings are scored in held-out episodes."""
    share: float = 1.0
    """Share of the race's error probability that belongs to the look at which it stopped: see `stats.spent`."""
    alone: bool = False
    """Whether the original text is the only one that trained to a policy which could be scored."""
    lost: Mapping[str, str] = field(default_factory=dict[str, str])
    """Messages of other weightings' trainings that ended early, by the weighting's name."""
    breach: str = ""
    """The limits that the policies of `after` break, on average over its final trainings; empty if none."""
    breach_before: str = ""
    """The same for the original text."""

    @property
    def done(self) -> bool:
        """Whether nothing is left to train or to score."""
        return self.alone or (self.judged and bool(self.after))

    @property
    def better(self) -> str:
        """Name of the weighting in `best/`. `after` replaces the original text if it keeps the limits, and has the
        higher mean of held-out F or is alone in keeping them."""
        if not self.after or self.breach:
            return ORIGINAL
        if self.breach_before:
            return self.after
        return max((ORIGINAL, self.after), key=lambda name: rank(mean(self.finals[name].scores)))

    @property
    def lawful(self) -> bool:
        """Whether the weighting in `best/` keeps the limits."""
        return not (self.breach if self.better == self.after else self.breach_before)

    @property
    def difference(self) -> Difference | None:
        """Held-out F after tuning minus that before. The interval allows for the best having been picked among several,
        and for every look at which the race might have stopped."""
        if not self.after:
            return None
        own, other = self.finals[self.after].scores, self.finals[ORIGINAL].scores
        rivals = [one.scores for name, one in self.finals.items() if name not in (self.after, ORIGINAL)]
        return difference(own, other, rivals, claims=(len(self.finals) - 1) / self.share)


def read(
    config: RunConfig,
    texts: Texts,
    results: Mapping[str, TrainingResult],
    played: Scores,
    evaluations: Scores,
) -> Tuned | None:
    """What the store of a run says of its tuning; None before that began.

    Args:
        played: scores of lanes when they were played to choose by.
        evaluations: scores of lanes in held-out episodes.
    """
    if ORIGINAL not in texts:
        return None
    trials, lanes = _weightings(config, texts, results, played), final_lanes(config, texts, results)
    after = winner(
        {name: [played.get(lane) for lane in own] for name, own in lanes.items() if name != ORIGINAL},
        config.cost_limits,
    )
    others = [trial for trial in trials if trial.name != ORIGINAL]
    raced = lanes if after else {}
    scores = {name: [evaluations.get(lane) or played.get(lane) for lane in own] for name, own in raced.items()}
    return Tuned(
        trials=trials,
        trained=sum(trial.result is not None for trial in trials),
        effects=_effects(texts[ORIGINAL], trials, after),
        after=after,
        finals={name: SeedScores.of(own, results, evaluations) for name, own in raced.items()},
        components=_components(*([results[lane] for lane in raced.get(name, ())] for name in (ORIGINAL, after))),
        judged=any(lane in evaluations for name, own in raced.items() for lane in own if name != ORIGINAL),
        share=race.share(len(lanes.get(after, ())), config.seeds),
        alone=not after and bool(lanes[ORIGINAL]) and all(trial.played is None for trial in others),
        lost={trial.name: trial.result.message for trial in others if trial.result and trial.result.message},
        breach=_breach(scores.get(after, ()), config.cost_limits),
        breach_before=_breach(scores.get(ORIGINAL, ()), config.cost_limits),
    )


def _weightings(
    config: RunConfig, texts: Texts, results: Mapping[str, TrainingResult], played: Scores
) -> tuple[Weighting, ...]:
    """The weightings whose numbers can be read from their texts."""
    found: list[Weighting] = []
    for name, candidate in texts.items():
        own, lane = values(candidate.source, texts[ORIGINAL].source), lane_id(candidate.id, config.seed)
        if own is not None:
            trial = Weighting(name=name, candidate=candidate, values=own, result=results.get(lane), played=None)
            found.append(trial if trial.cut else replace(trial, played=_fitness(played.get(lane))))
    return tuple(found)


def _breach(scores: Sequence[Evaluation | None], limits: Limits) -> str:
    known = [score for score in scores if score is not None]
    return breach(pooled(known), limits) if known else ""


def size(config: RunConfig) -> int:
    """Weightings of a round, at least `FEWEST_TUNED`. After a search, `sample` is the size of a generation: rounds of
    that size would be few, and the scores of the first would guide little. So a round has a quarter of all, at most."""
    most = config.sample if config.model == NO_MODEL else min(config.sample, config.tune // 4)
    return max(most, FEWEST_TUNED)


def rounds(config: RunConfig) -> list[range]:
    """The numbers of the weightings of each round; 0 is the original text."""
    step = size(config)
    return [range(first, min(first + step, config.tune)) for first in range(0, config.tune, step)]


def final_lanes(
    config: RunConfig, texts: Texts, results: Container[str], seeds: Sequence[int] | None = None
) -> dict[str, list[str]]:
    """Ids of the lanes that trained with fresh seeds, by name: the original text first, then others that have some.

    Args:
        seeds: fresh seeds to look for; None for all that a run may take.
    """
    wanted = tuning_seeds(config) if seeds is None else seeds
    found = {
        name: [lane for seed in wanted if (lane := lane_id(candidate.id, seed)) in results]
        for name, candidate in distinct(texts).items()
    }
    return {name: lanes for name, lanes in found.items() if lanes or name == ORIGINAL}


def distinct(texts: Texts) -> Texts:
    """Each text once, under its first name: proposals are rounded, so two may be equal, or equal to the original."""
    names: dict[str, str] = {}
    for name in sorted(texts, key=lambda name: name != ORIGINAL):
        names.setdefault(texts[name].id, name)
    return {name: candidate for name, candidate in texts.items() if names[candidate.id] == name}


def winner(scores: Mapping[str, Sequence[Evaluation | None]], limits: Limits) -> str:
    """Name of the weighting that keeps the limits, raced longest and plays best on average, in this order of
    importance; empty where none raced."""

    def standing(name: str) -> tuple[bool, int, float]:
        keeps = lawful([score for score in scores[name] if score is not None], limits)
        return keeps, len(scores[name]), rank(mean([_fitness(score) for score in scores[name]]))

    return max(scores, key=standing, default="")


def log_factor(value: float, weight: Weight) -> float:
    """How many steps of the weight a value is above the original one, in logarithms; 0 where that is undefined."""
    ratio = value / weight.value if weight.value else 0.0
    return math.log(ratio) / weight.step if ratio > 0 else 0.0


def _fitness(score: Evaluation | None) -> float | None:
    return score.fitness if score is not None else None


# --- which numbers matter --------------------------------------------------------------------------------------------


def _effects(origin: Candidate, trials: Sequence[Weighting], after: str) -> tuple[Effect, ...]:
    whole = [trial for trial in trials if trial.result is not None and not trial.cut]
    fitted = next((trial.values for trial in trials if trial.name == after), None)
    return tuple(
        Effect(
            weight=weight,
            after=fitted[place] if fitted is not None else None,
            trend=_trend([trial.values[place] for trial in whole], whole),
            distance=_trend([abs(log_factor(trial.values[place], weight)) for trial in whole], whole),
        )
        for place, weight in enumerate(weights(origin.source))
    )


def _trend(xs: Sequence[float], trials: Sequence[Weighting]) -> Correlation | None:
    """Correlation with played F; an undefined F has the lowest rank."""
    return correlation(xs, [rank(trial.played) for trial in trials])


def correlation(xs: Sequence[float], ys: Sequence[float], *, claims: int = 2) -> Correlation | None:
    """Spearman's rank correlation; None below five pairs or where either is constant.

    The interval is that of Fisher's z with the variance 1.06 / (n - 3) (Fieller, Hartley and Pearson 1957).

    Args:
        claims: how many such intervals are to hold together (Bonferroni).
    """
    value = spearman(xs, ys) if len(xs) >= FEWEST else None
    if value is None:
        return None
    quantile = NormalDist().inv_cdf(1 - (1 - CONFIDENCE) / (2 * claims))
    middle, half = math.atanh(min(max(value, -0.9999), 0.9999)), quantile * math.sqrt(1.06 / (len(xs) - 3))
    return Correlation(value=value, low=math.tanh(middle - half), high=math.tanh(middle + half))


def _components(
    before: Sequence[TrainingResult], after: Sequence[TrainingResult]
) -> dict[str, tuple[float | None, float | None]]:
    names = dict.fromkeys(name for result in before for name in of_components(result.curves))
    return {name: (_late(before, COMPONENT + name), _late(after, COMPONENT + name)) for name in names}


def _late(results: Sequence[TrainingResult], name: str) -> float | None:
    """Mean over the last tenth of the epochs, and over seeds."""
    curves = [result.curves.get(name, ()) for result in results]
    return mean([mean(curve[-max(1, round(LAST * len(curve))) :]) for curve in curves if curve])
