"""Does a screen pick rewards that train better than those that chance picks? At equal steps, as both train as many.

    python benchmarks/screening.py                         # all tasks; an hour or two on 2 cores
    python benchmarks/screening.py --env ballbalance       # one

So many of a strong model's committed rewards train with one seed, each with the task's own steps. Then searches are
drawn from them: 8 rewards are the first generation, the other 24 are what the model writes next, and `screen=3` picks 8
of these by the recorded episodes of the first 8 and of both baselines. The picked ones are compared with 8 that chance
picks of the same 24, over all ways to do so. No search is trained for it: a draw decides which results count.

The interval comes from leaving out each reward in turn (the jackknife): it says how the answer would vary with other
rewards of this model for this task, not with other tasks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from random import Random
from typing import NamedTuple

import choosing
from intervals import interval
from ledger import Script, whole
from records import FOLDER, OUTPUTS, Record, command_line, machine, once, read, results, show

from openeureka.config import RunConfig
from openeureka.method import screen
from openeureka.method.lanes import Lanes
from openeureka.method.seeds import deal, trained_baselines
from openeureka.numbers import number
from openeureka.reward import extract
from openeureka.runs.compose import comparing
from openeureka.runs.rewards import judge
from openeureka.stats import jackknife, mean
from openeureka.types import Candidate, CandidateId, Episodes, Place, Reply, RewardGraph, lane_id

RESULTS = results("screening")
ENVS = ("ballbalance", "quadcopter", "ant")
"""Tasks with enough committed rewards."""
FOLDERS = ("choosing", "prompts", "generations", "longer", "claims")
"""Of replies, those that are taken first."""
TRAINED, WRITTEN = 8, 24
"""Rewards that a generation trains, and that the screen picks from."""
DRAWS, LEFT_OUT = 1000, 200
"""Searches that are drawn, and for each reward that is left out."""
TITLES = (
    "task", "rewards", "best of 8, screened", "by chance", "difference, 95 % interval",
    "mean of 8, screened", "by chance", "difference, 95 % interval",
    "dropped for disagreeing", "F of these", "of others",
)  # fmt: skip


class Scores(NamedTuple):
    """F of a lane's policy: in the episodes that a search chooses by, and in held-out ones."""

    played: float
    held_out: float


class Pool(NamedTuple):
    """Rewards of a task that trained alike, and what each would have paid in the recorded episodes."""

    scores: Mapping[CandidateId, Scores]
    episodes: Mapping[str, Episodes]
    """By lane; those of the baselines as well."""
    paid: Mapping[CandidateId, Mapping[str, Sequence[float]]]
    """By reward and lane."""


class Drawn(NamedTuple):
    """What one search, or the mean of many, comes to."""

    best: float
    """Held-out F of the screened reward that plays best."""
    best_by_chance: float
    mean: float
    """Held-out F of all screened rewards."""
    mean_by_chance: float
    dropped: float
    """Rewards that were dropped as they disagree with F."""
    dropped_sum: float
    """Sum of their held-out F."""


def texts(env: str) -> dict[Candidate, str]:
    """Distinct programs in the committed replies of a task, each with its first reply."""
    found: dict[Candidate, str] = {}
    for folder in FOLDERS:
        path = FOLDER / folder / f"{env}.json"
        for text in _strings(read(path).get("replies")):
            if "def compute_reward" in (program := extract.program(text) or ""):
                found.setdefault(Candidate.of(program), text)
    return found


def _strings(replies: object) -> Iterator[str]:
    """Replies as folders keep them: in lists, by arm, or with their place."""
    if isinstance(replies, str):
        yield replies
    elif isinstance(replies, Mapping):
        for value in replies.values():
            yield from _strings(value)
    elif isinstance(replies, Sequence):
        for value in replies:
            yield from _strings(value)


def graphs(env: str, lanes: Lanes) -> dict[CandidateId, RewardGraph]:
    """The first accepted programs of a task that differ, as many as a draw needs."""
    found: dict[str, tuple[CandidateId, RewardGraph]] = {}
    for candidate, text in texts(env).items():
        verdict = lanes.store.rewards.verdict(candidate.id)
        if verdict is None:
            (verdict,) = judge(env, [candidate], unsafe=False)
            lanes.store.rewards.save_verdict(candidate, verdict, Reply(text=text, model="replay"))
        if verdict.graph is not None:
            found.setdefault(str(verdict.graph), (candidate.id, verdict.graph))
        if len(found) == TRAINED + WRITTEN:
            break
    return dict(found.values())


def trained(env: str) -> Pool:
    """Train what is missing, let it play, and let every reward judge all recorded episodes."""
    config = RunConfig(env=env, model="replay", steps=choosing.STEPS[env], seed=0, screen=WRITTEN // TRAINED)
    with comparing(config, OUTPUTS / "screening" / env, Script()) as lanes:
        own = graphs(env, lanes)
        wanted = deal(own.items(), [0], "candidate") + deal(trained_baselines(config), [0], "baseline")
        ids = list(lanes.train(wanted))
        lanes.play(ids)
        played, held_out = lanes.first_looks(ids), lanes.evaluate(lanes.counted_peaks(ids))
        scores: dict[CandidateId, Scores] = {}
        for name in own:
            lane = lane_id(name, 0)
            if lane in played and lane in held_out:
                first, later = played[lane].fitness, held_out[lane].fitness
                if first is not None and later is not None:
                    scores[name] = Scores(first, later)
        episodes = {lane: found for lane in ids if (found := lanes.store.lanes.episodes(lane)) is not None}
        paid = {name: dict[str, Sequence[float]]() for name in own}
        for lane, one in episodes.items():
            for name, values in lanes.trainer.rewards(env, own, [one]).items():
                paid[name][lane] = values
        lanes.store.end()
        return Pool(scores, episodes, paid)


def searched(pool: Pool, names: Sequence[CandidateId]) -> Drawn:
    """Take the first of these rewards as the first generation, screen the others, and compare with chance."""
    first, later = names[:TRAINED], names[TRAINED:]
    seen = [lane for lane in (*(lane_id(name, 0) for name in first), "human-s0", "sparse-s0") if lane in pool.episodes]
    witnesses = [pool.episodes[lane] for lane in seen]

    def rated(name: CandidateId, place: Place, prompt: int) -> screen.Rated:
        own = pool.paid[name]
        paid = [value for lane in seen for value in own[lane]] if all(lane in own for lane in seen) else None
        return screen.rate(place, prompt, paid, witnesses)

    before = [rated(name, Place(0, slot), -1) for slot, name in enumerate(first)]
    fresh = {name: rated(name, Place(1, slot), 0) for slot, name in enumerate(later)}
    decided = screen.choose([*fresh.values()], before, [TRAINED])
    kept = [name for name in later if decided[fresh[name].place].kept]
    dropped = [name for name in later if decided[fresh[name].place].reason.startswith("agreement")]
    scores = pool.scores
    return Drawn(
        best=scores[max(kept, key=lambda name: scores[name].played)].held_out,
        best_by_chance=by_chance([scores[name] for name in later]),
        mean=_mean(scores[name].held_out for name in kept),
        mean_by_chance=_mean(scores[name].held_out for name in later),
        dropped=len(dropped),
        dropped_sum=sum(scores[name].held_out for name in dropped),
    )


def by_chance(scores: Sequence[Scores]) -> float:
    """Held-out F of the one that plays best of 8, mean over all ways to pick 8."""
    ordered = sorted(scores, key=lambda one: -one.played)
    ways = [math.comb(len(ordered) - 1 - place, TRAINED - 1) for place in range(len(ordered))]
    return sum(way * one.held_out for way, one in zip(ways, ordered, strict=True)) / math.comb(len(ordered), TRAINED)


def many(pool: Pool, draws: int, without: CandidateId = "") -> Drawn:
    """The mean of so many searches. Those without a reward are the same draws, so that the difference is its doing."""
    random, names = Random(0), list(pool.scores)
    orders = (random.sample(names, len(names)) for _ in range(draws))
    found = [searched(pool, [name for name in order if name != without]) for order in orders]
    return Drawn(*(_mean(values) for values in zip(*found, strict=True)))


def measure(env: str) -> Record:
    pool = trained(env)
    found, without = many(pool, DRAWS), [many(pool, LEFT_OUT, name) for name in pool.scores]
    return {
        "steps": choosing.STEPS[env],
        "recipe": whole(env, env_steps=choosing.STEPS[env]),
        "scores": {name: one._asdict() for name, one in pool.scores.items()},
        "draws": DRAWS,
        "found": found._asdict(),
        "best": _between(found.best - found.best_by_chance, [one.best - one.best_by_chance for one in without]),
        "mean": _between(found.mean - found.mean_by_chance, [one.mean - one.mean_by_chance for one in without]),
        **machine("cpu"),
    }


def _between(value: float, without: Sequence[float]) -> list[float]:
    """A mean over draws and its interval by the jackknife over rewards."""
    half = 1.96 * jackknife(without)
    return [value, value - half, value + half]


def _mean(values: Iterator[float] | Sequence[float]) -> float:
    found = mean(list(values))
    assert found is not None
    return found


def rows(measured: Record) -> list[tuple[str, ...]]:
    """A row a task."""
    return [_row(env, measured[env]) for env in ENVS if env in measured]


def _row(env: str, own: Record) -> tuple[str, ...]:
    found = Drawn(**own["found"])
    written = len(own["scores"]) - TRAINED
    others = found.mean_by_chance * written - found.dropped_sum
    return (
        env,
        str(len(own["scores"])),
        number(found.best),
        number(found.best_by_chance),
        interval(*own["best"], digits=3),
        number(found.mean),
        number(found.mean_by_chance),
        interval(*own["mean"], digits=3),
        f"{found.dropped:.1f} of {written}",
        number(found.dropped_sum / found.dropped) if found.dropped else "-",
        number(others / (written - found.dropped)),
    )


def summary(measured: Record) -> str:
    """On how many tasks the screen picks better, or worse, than chance."""
    own = [measured[env]["best"] for env in ENVS if env in measured]
    better, worse = sum(low > 0 for _, low, _ in own), sum(high < 0 for _, _, high in own)
    told = f"The best of what it picks is better than the best of what chance picks on {better} of {len(own)} tasks"
    return f"{told}, worse on {worse}. On the others no difference is shown."


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=ENVS, nargs="+", default=list(ENVS))
    for env in parser.parse_args().env:
        once(RESULTS, env, partial(measure, env))
    measured = read(RESULTS)
    show(TITLES, *rows(measured), (summary(measured),))
