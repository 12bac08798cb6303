"""Confirms the winner by training the leading rewards again, with fresh seeds: more only while it is undecided.

One training says little about a reward: another seed may change the ranking.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from ..config import RunConfig
from ..events import Began
from ..reward.form import form
from ..score import Outcome, SeedScores, lawful, level, rank, worth
from ..stats import difference, mean, pearson, spent
from ..strategies import Ranking
from ..types import CandidateId, Evaluation, History, Place, RewardProgram, Scored, TrainingResult
from . import baselines, hacking
from .lanes import Lanes
from .seeds import deal, final_lanes, final_seeds, programs, trained_baselines

CONTENDERS = 3
"""The most rewards that train again."""
FIRST = 2
"""Seeds of the first round: a single one has no spread, so it decides nothing."""

Scores = Mapping[str, Sequence[float]]
"""Played F of every final lane, by the name of its reward."""
Look = Callable[[Sequence[str], Sequence[int], Sequence[int]], tuple[Scores, Sequence[str]]]
"""A round of a race. Takes the names of rewards, the seeds that they train with now, and all seeds so far; gives the
scores of all rewards with all seeds so far, and the names of those that may win. A resumed race thus decides each round
by what it knew then."""


def conclude(history: History, lanes: Lanes) -> None:
    """Confirm the best reward with fresh seeds, then score it beside the human and the sparse one on held-out episodes.
    If a reward is confirmed, the store holds its crown, and `best/` its policy.

    The search's own scores are the best of many tries; only fresh seeds and fresh episodes say what a reward is worth.
    """
    config, store, tell = lanes.config, lanes.store, lanes.tell
    tell(Began("final"))
    confirmed = history.entry(store.crown())
    best = confirmed or crown(history, lanes)
    if best is None:
        lanes.keep(Ranking(history).best)
        return _score_nearest(history, lanes)
    tell(Began("evaluate"))
    finals = lanes.final(contenders(history))
    scores = lanes.evaluate(lanes.counted_peaks([lane for own in finals.values() for lane in own]))
    results = store.lanes.results()
    own = {lane: results[lane] for lane in finals[best.candidate_id] if lane in scores}
    winner = max(own, key=lambda lane: worth(scores[lane], config.cost_limits), default=None)
    lanes.keep(best, winner)
    if winner is not None:
        lanes.try_out(hacking.tryouts(own, winner, store.lanes.all()[winner].seed, lanes.counted_peaks(own)))
    if confirmed is None:
        store.save_crown(best.sample.place)


def _score_nearest(history: History, lanes: Lanes) -> None:
    """Where no reward wins, score the candidate that came nearest, held out, so that there are numbers to report."""
    ranking = Ranking(history)
    nearest = ranking.nearest or ranking.best
    if nearest is not None and nearest.result is not None:
        lanes.tell(Began("evaluate"))
        lanes.evaluate(lanes.counted_peaks([nearest.result.lane]))


def contenders(history: History) -> tuple[Scored, ...]:
    """The best reward of a search, then those level with it within the errors; of rewards that pay the same, the first.

    Where a person's votes decide, or nothing was played, only the best.
    """
    ranking = Ranking(history)
    best = ranking.best
    if best is None or best.played is None or ranking.by_votes:
        return (best,) if best is not None else ()
    keeping = (entry for entry in history.entries if not entry.breaks(history.limits))
    able = {name: entry for name, entry in _first_of_each(keeping).items() if name not in ranking.rejected}
    close = level({name: entry.played for name, entry in able.items() if entry.played is not None})
    ordered = sorted((able[name] for name in close), key=lambda entry: -rank(entry.score))
    different: dict[str, Scored] = {}
    for entry in (best, *ordered):
        graph = entry.sample.verdict.graph
        different.setdefault(form(graph) if graph is not None else "", entry)
    return tuple(different.values())[:CONTENDERS]


def crown(history: History, lanes: Lanes) -> Scored | None:
    """The best of the contenders by played F of fresh trainings; None when nothing ever trained, or each contender
    breaks a limit, on average over its fresh trainings.

    They race the human reward. The sparse reward does not race: its training beside the first generation marks the
    scale's other end. Where nothing is played, the best of the search and both baselines train with all seeds at once.

    Raises:
        WorkerError: see `Lanes.train`.
    """
    racing = {entry.candidate_id: entry for entry in contenders(history)}
    if not racing:
        return None
    config, seeds, known = lanes.config, final_seeds(lanes.config), baselines.chosen(lanes.config)
    baselines_too = trained_baselines(config)
    human_too = [reward for reward in baselines_too if reward[0] == "human"]

    def train(names: Iterable[str], more: Iterable[int], others: Iterable[tuple[str, RewardProgram]]) -> None:
        lanes.train(deal([*programs(racing[name].sample for name in names), *others], more, "final"))

    def look(names: Sequence[str], more: Sequence[int], so_far: Sequence[int]) -> tuple[Scores, Sequence[str]]:
        train(names, more, human_too)
        first, scores = play_finals(lanes, lanes.final(tuple(racing.values()), so_far))
        if known is not None:
            scores["human"] = list(known.human.scores)
        return scores, [name for name in racing if lawful(first[name], history.limits)]

    if lanes.ranks != "played":
        train(racing, seeds, baselines_too)
        return next(iter(racing.values()))
    left = hold([*racing], "human", seeds, look)
    return racing[left[0]] if left else None


def play_finals(
    lanes: Lanes, finals: Mapping[str, Sequence[str]]
) -> tuple[dict[str, list[Evaluation]], dict[str, list[float]]]:
    """Let final lanes play. Gives their first looks by the name of the reward, and F of those looks where defined."""
    ids = [lane for own in finals.values() for lane in own]
    lanes.play(ids)
    played = lanes.first_looks(ids)
    first = {name: [played[lane] for lane in own if lane in played] for name, own in finals.items()}
    return first, {name: [look.fitness for look in own if look.fitness is not None] for name, own in first.items()}


def outcome(
    config: RunConfig,
    history: History,
    place: Place | None,
    results: Mapping[str, TrainingResult],
    scores: Mapping[str, Evaluation],
    tryouts: Mapping[str, Mapping[str, Evaluation]],
) -> Outcome:
    """What a search found, by its final trainings (`results`), held-out `scores` and `tryouts` so far, all by lane id;
    without a crowned reward, none has won."""
    best = history.entry(place)
    if best is None:
        return Outcome(best=None)
    others = _first_of_each(sorted(history.entries, key=lambda entry: -rank(entry.score)))
    others.pop(best.candidate_id, None)
    lanes = final_lanes(config, [best, *others.values()], results, scores)
    known, trained = baselines.chosen(config), [results[lane] for lane in lanes[best.candidate_id]]
    curves = [(result.curves.get("reward", ()), result.curves.get("human_reward", ())) for result in trained]
    by_seed = {name: SeedScores.of(own, results, scores) for name, own in lanes.items()}
    return Outcome(
        best=best,
        method=by_seed[best.candidate_id],
        human=known.human if known else by_seed["human"],
        sparse=known.sparse if known else by_seed["sparse"],
        untrained=tuple(score for own in trained for score in hacking.untrained(tryouts.get(own.lane, {}))),
        # Those that raced, and not those that today's scores would choose: lanes that play later may change these.
        rivals={entry.sample.place: by_seed[name] for name, entry in others.items() if lanes[name]},
        share=share(len(trained), config.seeds) if best.played is not None else 1.0,
        correlation=mean([result.correlation for result in trained]),
        curve_correlation=mean([pearson(own, human) for own, human in curves]),
    )


def hold(names: Sequence[str], against: str, seeds: Sequence[int], look: Look) -> list[str]:
    """Race rewards: all train with two seeds, then, a seed at a time, those that are not yet shown to be worse than the
    leader, until one is left whose difference to the reward `against` is beyond doubt.

    Args:
        seeds: all seeds that they may take.

    Returns: the names that are left, the leader first; none where no reward may win.
    """
    left, trained = list(names), 0
    for more in rounds(seeds, raced=True):
        trained += len(more)
        scores, able = look(left, more, seeds[:trained])
        # Rewards that lost to a leader that may no longer win come back.
        left = [name for name in left if name in able] or list(able)
        if not left:
            break
        left = unbeaten(scores, left)
        # The winner was picked among all, and each further look may err again: both call for more certainty.
        if len(left) == 1 and sure(scores, left[0], against, len(names) / share(trained, len(seeds))):
            break
    return left


def rounds(seeds: Sequence[int], *, raced: bool) -> Iterator[Sequence[int]]:
    """The seeds of each round: some together, then one at a time; all together where there is no race."""
    together = FIRST if raced else len(seeds)
    yield seeds[:together]
    yield from (seeds[index : index + 1] for index in range(together, len(seeds)))


def share(trained: int, seeds: int) -> float:
    """Share of a race's error probability for a race that stops after so many of its seeds: see `stats.spent`."""
    return spent(trained, seeds, FIRST)


def unbeaten(scores: Scores, names: Sequence[str]) -> list[str]:
    """The names not yet shown to be worse than the leader, which comes first. A reward whose trainings all diverged is
    shown to be worse as soon as another has a score."""
    ordered = sorted(names, key=lambda name: -rank(mean(scores[name])))
    scored = [name for name in ordered if scores[name]] or ordered
    return [name for name in scored if name == scored[0] or not sure(scores, scored[0], name, len(names) - 1)]


def sure(scores: Scores, own: str, other: str, claims: float = 1) -> bool:
    """Whether the difference of two rewards is beyond doubt."""
    rivals = [values for name, values in scores.items() if name not in (own, other, "sparse")]
    found = difference(scores[own], scores.get(other, ()), rivals, claims=claims)
    return found is not None and found.sure


def _first_of_each(entries: Iterable[Scored]) -> dict[CandidateId, Scored]:
    """The first entry of each program, by the program's id."""
    found: dict[CandidateId, Scored] = {}
    for entry in entries:
        found.setdefault(entry.candidate_id, entry)
    return found
