"""Keeps the structure of a reward and fits its numbers: rounds of weightings train side by side, then the best race.

A weighting is a reward text with other numbers. Each is judged, kept and trained like any other reward, so that a
resumed run proposes the same again and trains nothing twice.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from ..config import NO_MODEL
from ..errors import StoreError
from ..events import Began
from ..method import race
from ..method.lanes import Lanes
from ..method.sampling import Checker
from ..method.seeds import deal, tuning_seeds
from ..reward.weights import Weight, values, weighed, weights
from ..score import lawful, rank, worth
from ..store import Store
from ..types import GIVEN, Candidate, PolicyId, Reply, RewardProgram, Scored, TrainingState, Verdict, lane_id
from . import tuned
from .tuned import ORIGINAL

SPREAD = 0.7
"""Standard deviation of the first proposals, in steps of a weight. With a step of 1, two thirds are within a factor of
two."""
RIVALS = 2
"""Number of weightings that race the original text."""
DIGITS, FARTHEST = 4, 10.0
"""Significant digits of a proposed number, and the most steps that it lies from the original one."""


class Optimiser:
    """CMA-ES over the logarithms of factors on the numbers of a text.

    Each round draws from a seed of its own. `tell` gets the numbers that stand in the texts. So the next proposals
    follow from the texts and their scores alone.
    """

    def __init__(self, origin: Sequence[Weight], size: int, seed: int) -> None:
        from cmaes import CMA  # pyright: ignore[reportMissingTypeStubs]  # loads scipy: a second that no search needs

        self._origin, self._size, self._seed = origin, size, seed
        self._method = CMA(mean=np.zeros(len(origin)), sigma=SPREAD, population_size=size)

    def ask(self, index: int) -> list[tuple[float, ...]]:
        """Numbers for the weightings of a round; the first weighting of the first round has the original ones."""
        digest = hashlib.blake2b(f"{self._seed}/{index}".encode(), digest_size=4).digest()
        self._method.reseed_rng(int.from_bytes(digest))
        points = [self._method.ask() for _ in range(self._size)]
        found = [tuple(map(_moved, self._origin, point)) for point in points]
        return found if index else [tuple(weight.value for weight in self._origin), *found[1:]]

    def tell(self, numbers: Sequence[Sequence[float]], fitness: Sequence[float | None]) -> None:
        """Report the scores of a round's weightings; undefined F is worst, and only the order counts."""
        keys = [rank(score) for score in fitness]
        points = [
            np.array([tuned.log_factor(value, weight) for value, weight in zip(own, self._origin, strict=True)])
            for own in numbers
        ]
        self._method.tell([(x, float(sum(other > key for other in keys))) for x, key in zip(points, keys, strict=True)])


def _moved(weight: Weight, steps: float) -> float:
    factor = math.exp(weight.step * min(max(steps, -FARTHEST), FARTHEST))
    return float(f"{weight.value * factor:.{DIGITS}g}")


def keep(store: Store, origin: Candidate, verdict: Verdict) -> None:
    """Have the store hold the text that is tuned, so that a resumed run needs no file.

    Raises:
        StoreError: when the store holds another text.
    """
    known = store.rewards.named()
    if known.get(ORIGINAL, origin.id) != origin.id:
        raise StoreError(f"{store.directory} tunes another reward; name that one, unchanged, or choose another dir=.")
    if store.rewards.verdict(origin.id) is None:
        store.rewards.save_verdict(origin, verdict, Reply(text=origin.source, model=GIVEN))
    if ORIGINAL not in known:
        store.rewards.save_named({ORIGINAL: origin.id})


def tune(lanes: Lanes, checker: Checker) -> PolicyId | None:
    """Train rounds of weightings, race the best of them against the original text, and score the racers held out.

    `best/` gets the original text or the winner among the others, whichever is better by mean held-out F.

    Returns:
        The policy in `best/`.

    Raises:
        EurekaError: what stopped it; all that was finished is stored, and calling again continues.
    """
    config, store = lanes.config, lanes.store
    origin = store.rewards.candidate(store.rewards.named().get(ORIGINAL))
    if origin is None:  # killed between the first rows of the run
        raise StoreError(f"{store.directory} holds no reward yet; start it again with the same `eureka tune` command.")
    optimiser = Optimiser(weights(origin.source), tuned.size(config), config.seed)
    every = tuned.rounds(config)
    for index, own in enumerate(every):
        names = [_name(number) for number in own]
        asked = optimiser.ask(index)[: len(own)]
        proposed = {name: weighed(origin.source, numbers) for name, numbers in zip(names, asked, strict=True)}
        _propose(lanes, checker, index, proposed)
        kept = store.rewards.texts()
        candidates = [kept[name] for name in names]
        last = own is every[-1]
        over = bool(_raced(lanes, kept)) if last else _name(own.stop) in kept
        _train(lanes, index, candidates, over=over)
        if not last:
            optimiser.tell(*_scores(lanes, candidates, origin))
    return _race(lanes)


def tune_winner(lanes: Lanes, checker: Checker, winner: Scored | None) -> PolicyId | None:
    """Fit the numbers of the reward that a search found, if it has any numbers; otherwise return None.

    Returns, Raises:
        EurekaError: as `tune` does.
    """
    lanes = replace(lanes, ranks="played")  # the search's own peaks stay: its winner is judged by one of these
    if begun(lanes.store):  # if no reward is crowned, the tuning's trainings may change which one leads
        return tune(lanes, checker)
    found = winner.sample if winner is not None else None
    if found is not None and found.candidate is not None and weights(found.candidate.source):
        keep(lanes.store, found.candidate, found.verdict)
        return tune(lanes, checker)
    return None


def begun(store: Store) -> bool:
    """Whether tuning has begun. From then on its trainings must not change which reward is tuned."""
    return ORIGINAL in store.rewards.named()


def _name(number: int) -> str:
    return f"trial_{number}" if number else ORIGINAL


def _propose(lanes: Lanes, checker: Checker, index: int, texts: Mapping[str, str]) -> None:
    """Judge and keep the weightings of a round, unless the store has them."""
    store, known = lanes.store, lanes.store.rewards.named()
    fresh = {name: Candidate.of(text) for name, text in texts.items() if name not in known}
    if fresh:
        lanes.tell(Began("check", round=index))
    for candidate in fresh.values():
        if store.rewards.verdict(candidate.id) is None:
            store.rewards.save_verdict(candidate, checker.check(candidate), Reply(text=candidate.source, model=GIVEN))
    store.rewards.save_named({name: candidate.id for name, candidate in fresh.items()})


def _programs(store: Store, candidates: Iterable[Candidate]) -> list[tuple[str, RewardProgram]]:
    """Programs of the accepted candidates, by id."""
    return [(own.id, program) for own in candidates if (program := store.rewards.program(own.id)) is not None]


def _train(lanes: Lanes, index: int, candidates: Iterable[Candidate], *, over: bool) -> None:
    """Train and play the weightings of a round.

    Args:
        over: whether this round's scores were used already, for the next round or the race: it need not play again.
    """
    lanes.tell(Began("train", round=index))
    results = lanes.train(deal(_programs(lanes.store, candidates), [lanes.config.seed], "tuned"))
    if not over:
        lanes.tell(Began("play", round=index))
        lanes.play(results)


def _scores(
    lanes: Lanes, candidates: Sequence[Candidate], origin: Candidate
) -> tuple[list[tuple[float, ...]], list[float | None]]:
    """The numbers of weightings, and the score of each: None for one whose policy breaks a limit. A weighting that a
    search cut gets the median of the others, as it trained for less."""
    ids, limits = [lane_id(candidate.id, lanes.config.seed) for candidate in candidates], lanes.config.cost_limits
    kept = {lane: score.fitness for lane, score in lanes.first_looks(ids).items() if not score.broken(limits)}
    lane = lane_id(origin.id, lanes.config.seed)
    came = lanes.store.lanes.result(lane)
    if came is not None and came.state is TrainingState.CUT and lane in ids:
        kept[lane] = median([score for own, score in kept.items() if own != lane and score is not None] or [0.0])
    numbers = [own for each in candidates if (own := values(each.source, origin.source)) is not None]
    if len(numbers) < len(candidates):
        raise StoreError(
            f"{lanes.store.directory} was started by a version that fits other numbers of this reward; tune it again "
            "with another dir=."
        )
    return numbers, [kept.get(lane) for lane in ids]


def _race(lanes: Lanes) -> PolicyId | None:
    """Train the leading weightings and the original text with fresh seeds, with more only while it is undecided."""
    config, store = lanes.config, lanes.store
    texts = store.rewards.texts()
    racing, seeds = _raced(lanes, texts) or _leading(lanes, texts), tuning_seeds(config)
    programs = {name: texts[name] for name in (ORIGINAL, *racing)}

    def look(names: Sequence[str], more: Sequence[int], so_far: Sequence[int]) -> tuple[race.Scores, Sequence[str]]:
        lanes.train(deal(_programs(store, [programs[name] for name in (ORIGINAL, *names)]), more, "final"))
        looks, scores = race.play_finals(lanes, tuned.final_lanes(config, programs, store.lanes.results(), so_far))
        return scores, [name for name in racing if lawful(looks[name], config.cost_limits)]

    lanes.tell(Began("final"))
    race.hold(racing, ORIGINAL, seeds, look)
    lanes.tell(Began("evaluate"))
    return _conclude(lanes, texts)


def _raced(lanes: Lanes, texts: tuned.Texts) -> list[str]:
    """Names of the weightings that were chosen to race; none before that."""
    seeds = tuning_seeds(lanes.config)
    final = {lane.reward for lane in lanes.store.lanes.all().values() if lane.role == "final" and lane.seed in seeds}
    return [name for name, candidate in tuned.distinct(texts).items() if name != ORIGINAL and candidate.id in final]


def _leading(lanes: Lanes, texts: tuned.Texts) -> list[str]:
    """Names of the best weightings by played F, those that keep the limits first; without the original text."""
    scores, limits = lanes.scores(), lanes.config.cost_limits
    others = {name: candidate for name, candidate in tuned.distinct(texts).items() if name != ORIGINAL}
    ids = {name: lane_id(candidate.id, lanes.config.seed) for name, candidate in others.items()}
    known = {name: scores[lane] for name, lane in ids.items() if lane in scores}
    best = sorted(known, key=lambda name: worth(known[name], limits), reverse=True)[:RIVALS]
    return [name for name in texts if name in best]  # in the order in which `_raced` finds them again


def _conclude(lanes: Lanes, texts: tuned.Texts) -> PolicyId | None:
    """Score the final trainings on held-out episodes, and put the better reward into `best/`. After a search, the
    original text is there already.

    Returns: the policy in `best/`; None where it breaks a limit.
    """
    config, store = lanes.config, lanes.store
    results = store.lanes.results()
    own = tuned.final_lanes(config, texts, results)
    scores = lanes.evaluate(lanes.counted_peaks([lane for ids in own.values() for lane in ids]))
    found = tuned.read(config, texts, results, lanes.scores(), scores)
    if found is None or not own[found.better]:
        return None
    held = store.best() if config.model != NO_MODEL and found.better == ORIGINAL else None
    if held is not None:  # the search chose and tried it
        return held if found.lawful else None
    lane = max(own[found.better], key=lambda lane: worth(scores.get(lane), config.cost_limits))
    policy = lanes.judged(lane)
    store.save_best(texts[found.better], policy)
    return policy if found.lawful else None
