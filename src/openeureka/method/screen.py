"""Asks for more rewards than train: those that pay against F are dropped, and of the rest the most different train.

This costs replies and no training. A reward is judged by what it would have paid in recorded episodes of earlier lanes:

- *agreement*: Spearman's rank correlation of its return in an episode with F of the episode. Its error comes from
  leaving out each lane in turn (the jackknife), as episodes of one policy are alike;
- *likeness* of two rewards: the absolute rank correlation of what they pay, state by state.

Agreement finds rewards that point the wrong way, but says little about the others. So the first step drops only clear
cases, and the second looks at variety alone.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from ..events import Checked
from ..score import ERRORS
from ..stats import jackknife, midranks
from ..types import CandidateId, Episodes, Finding, History, Place, PromptPlan, Sample, Screened, Verdict, VerdictCode
from .lanes import Lanes
from .sampling import Sampler
from .seeds import programs

MARGIN = 0.3
"""How far below the median agreement a reward's agreement must be, beyond its error, before the reward is dropped."""
WITNESSES = 32
"""The most lanes whose recorded episodes are used."""

Vector = np.ndarray[tuple[int], np.dtype[np.float64]]


def fill(
    generation: int, plans: Sequence[PromptPlan], sampler: Sampler, lanes: Lanes, history: History
) -> tuple[Sample, ...]:
    """A sample per slot, of which as many can train as the plans ask for; the verdict of each sample that is left out
    says why.

    Once episodes of an earlier generation are recorded, `screen=` times as many slots are asked for; a generation of
    one given reward will do. Each prompt gets as many trainings as its plan asks for.
    """
    witnesses = _witnesses(lanes, history)
    if not witnesses:
        return sampler.fill(generation, plans)
    times = lanes.config.screen
    samples = sampler.fill(generation, [replace(plan, count=times * plan.count) for plan in plans])
    decided = {place: one for place, one in lanes.store.screens.all().items() if place.generation == generation}
    if not decided:
        prompts = [number for number, plan in enumerate(plans) for _ in range(times * plan.count)]
        decided = decide(samples, prompts, [plan.count for plan in plans], witnesses, lanes, history)
        lanes.store.screens.save(decided.values())
    return tuple(_told(sample, decided.get(sample.place), lanes) for sample in samples)


def _told(sample: Sample, decision: Screened | None, lanes: Lanes) -> Sample:
    if decision is None or decision.kept:
        return sample
    screened = replace(sample, verdict=verdict(sample.verdict.candidate, decision))
    lanes.tell(Checked(screened))
    return screened


def _witnesses(lanes: Lanes, history: History) -> list[Episodes]:
    """Recorded episodes, lane by lane, of finished generations alone: a resumed run must judge by the same.

    If there are too many lanes, the chosen ones are spread evenly over F.
    """
    if lanes.config.screen == 1 or not history.generations:
        return []
    log = lanes.store.lanes
    records, plays = log.all(), log.plays()
    names = [*history.lanes, *(lane for lane, record in records.items() if record.role == "baseline")]
    found = {lane: own for lane in dict.fromkeys(names) if lane in plays and (own := log.episodes(lane)) is not None}
    ordered = sorted(found, key=lambda lane: np.mean([f for f in found[lane].fitness if f is not None] or [-math.inf]))
    places = np.linspace(0, len(ordered) - 1, min(len(ordered), WITNESSES)).round().astype(int).tolist()
    return [found[ordered[place]] for place in places]


def verdict(candidate: CandidateId, decision: Screened) -> Verdict:
    """The verdict on a program that could train and is left out."""
    finding = Finding(rule="screened", message=decision.reason)
    return Verdict(candidate=candidate, code=VerdictCode.SCREENED, findings=(finding,))


# --- what is known of each reward ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Rated:
    """A reward, and what it would have paid."""

    place: Place
    """The first slot that holds the reward."""
    prompt: int
    """Index of the generation's prompt that asked for it."""
    agreement: float | None
    error: float | None
    pay: Vector | None
    """Ranks of what it pays, state by state, centred and scaled to length 1; None where it pays the same in all."""


def rate(place: Place, prompt: int, paid: Sequence[float] | None, witnesses: Sequence[Episodes]) -> Rated:
    """Rate a reward by what it pays, state by state; `paid` is None where that could not be computed."""
    if paid is None or len(paid) != sum(len(own.owners) for own in witnesses):
        return Rated(place, prompt, None, None, None)
    returns: list[float] = []
    worth: list[float] = []
    lane: list[int] = []
    start = 0
    for number, own in enumerate(witnesses):
        values, owners = np.asarray(paid[start : start + len(own.owners)]), np.asarray(own.owners)
        start += len(own.owners)
        for episode, (fitness, steps) in enumerate(zip(own.fitness, own.steps, strict=True)):
            states = values[owners == episode]
            if fitness is not None and len(states):
                returns.append(float(states.mean()) * steps)
                worth.append(fitness)
                lane.append(number)
    agreement, error = _agreement(np.asarray(returns), np.asarray(worth), np.asarray(lane))
    return Rated(place, prompt, agreement, error, _ranks(np.asarray(paid)))


def _agreement(returns: Vector, worth: Vector, lane: Vector) -> tuple[float | None, float | None]:
    """Spearman's rank correlation, and its error by the jackknife over lanes."""
    whole = _correlation(returns, worth)
    left = [_correlation(returns[lane != one], worth[lane != one]) for one in np.unique(lane)]
    known = [one for one in left if one is not None]
    if whole is None or len(known) < max(3, len(left)):
        return whole, None
    return whole, jackknife(known)


def _correlation(a: Vector, b: Vector) -> float | None:
    one, other = _ranks(a), _ranks(b)
    return float(one @ other) if one is not None and other is not None else None


def _ranks(values: Vector) -> Vector | None:
    """Ranks, centred and scaled to length 1, so that a correlation is a dot product; None if all values are equal."""
    if not len(values):
        return None
    found = midranks(values)
    found = found - found.mean()
    length = float(np.linalg.norm(found))
    return found / length if length > 0.0 else None


# --- who trains ------------------------------------------------------------------------------------------------------


def decide(
    samples: Sequence[Sample],
    prompts: Sequence[int],
    rooms: Sequence[int],
    witnesses: Sequence[Episodes],
    lanes: Lanes,
    history: History,
) -> dict[Place, Screened]:
    """A decision for each accepted program that never trained; equal ones share it. The others are not screened.

    Args:
        prompts: for each sample, the index of the prompt that it answers.
        rooms: for each prompt, how many of its answers may train.
    """
    trained = dict[CandidateId, Sample]()
    for entry in history.entries:
        if entry.result is not None:
            trained.setdefault(entry.candidate_id, entry.sample)
    asked = dict[CandidateId, tuple[Sample, int]]()
    for sample, prompt in zip(samples, prompts, strict=True):
        if sample.verdict.accepted and sample.verdict.candidate not in trained:
            asked.setdefault(sample.verdict.candidate, (sample, prompt))
    answers = Counter(prompt for _, prompt in asked.values())
    if all(answers[prompt] <= room for prompt, room in enumerate(rooms)):
        return {}  # there is room for all
    graphs = dict(programs([*trained.values(), *(sample for sample, _ in asked.values())]))
    paid = lanes.trainer.rewards(lanes.config.env, graphs, witnesses)
    fresh = {name: rate(sample.place, prompt, paid.get(name), witnesses) for name, (sample, prompt) in asked.items()}
    before = [rate(sample.place, -1, paid.get(name), witnesses) for name, sample in trained.items()]
    chosen = choose([*fresh.values()], before, rooms)
    return {
        sample.place: replace(chosen[fresh[name].place], place=sample.place)
        for sample in samples
        if (name := sample.verdict.candidate) in fresh
    }


def choose(fresh: Sequence[Rated], before: Sequence[Rated], rooms: Sequence[int]) -> dict[Place, Screened]:
    """Decisions by slot.

    Of the rewards that do not disagree with F, the one least like any before it trains next, the earlier slot of
    equals, as long as its prompt has room. Remaining room goes to those that disagree, the best agreement first: a
    generation never trains fewer rewards than it would without a screen.
    """
    known = [one.agreement for one in fresh if one.agreement is not None]
    middle = median(known) if known else 0.0
    wrong = [one for one in fresh if _disagrees(one, max(0.0, middle - MARGIN))]
    left = [one for one in fresh if one not in wrong]
    room, kept = list(rooms), list[Rated]()
    while able := [one for one in left if room[one.prompt]]:
        taken = min(able, key=lambda one: _nearest(one, [*before, *kept])[1])
        kept.append(taken)
        left.remove(taken)
        room[taken.prompt] -= 1
    for one in sorted(wrong, key=lambda one: -(one.agreement or 0.0)):
        if room[one.prompt]:
            kept.append(one)
            room[one.prompt] -= 1
    return {one.place: _decision(one, before, kept, one in wrong, middle) for one in fresh}


def _disagrees(one: Rated, least: float) -> bool:
    """Whether the agreement is below `least` by more than its errors; an unknown one counts for the reward."""
    return one.agreement is not None and one.error is not None and one.agreement + ERRORS * one.error < least


def _nearest(one: Rated, others: Iterable[Rated]) -> tuple[Rated | None, float]:
    """The reward most like this one, and how much; a reward of which nothing is known counts as like all."""
    if one.pay is None:
        return None, 1.0
    alike = [(other, min(1.0, abs(float(one.pay @ other.pay)))) for other in others if other.pay is not None]
    return max(alike, key=lambda pair: pair[1], default=(None, 0.0))


def _decision(one: Rated, before: Sequence[Rated], kept: Sequence[Rated], wrong: bool, middle: float) -> Screened:
    nearest, likeness = _nearest(one, [*before, *(other for other in kept if other is not one)])
    reason = ""
    if one not in kept:
        if wrong:
            reason = f"agreement with F {one.agreement:.2f} ± {one.error:.2f}, of others {middle:.2f}"
        elif nearest is not None:
            reason = f"it pays as {nearest.place} does (rank correlation {likeness:.2f}), others differ more"
        else:
            reason = "it pays the same in every recorded state, or cannot be computed there"
    return Screened(
        place=one.place,
        kept=one in kept,
        agreement=one.agreement,
        error=one.error,
        nearest=nearest.place if nearest is not None else None,
        likeness=likeness if nearest is not None else None,
        reason=reason,
    )
