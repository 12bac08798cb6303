"""Which number of one training says how good a reward is: F in training, or F when its policies are played?

    python benchmarks/choosing.py                          # all tasks; hours on 2 cores
    python benchmarks/choosing.py --env quadcopter         # one
    make docs                                              # what is known, as tables in docs/reference/measurements.md

A strong model's rewards (`benchmarks/choosing/TASK.json`: replies to the first prompt of a search) and the human reward
train with seed 0, as a search would train them, and with further seeds, as a final training would. Every policy that a
lane leaves is played twice: on the start states that a search chooses by, and on held-out ones. What is done is in the
store of a run under `outputs/choosing/` and in `benchmarks/results/choosing.json`, and is not repeated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import comb
from typing import get_args

from lanes import by_reward
from ledger import Script, refuse_other_recipe, whole
from records import FOLDER, OUTPUTS, Record, command_line, machine, read, results, write

from openeureka.config import RunConfig
from openeureka.method.race import CONTENDERS
from openeureka.method.seeds import deal
from openeureka.numbers import number
from openeureka.reward import extract
from openeureka.runs.compose import comparing
from openeureka.runs.rewards import judge
from openeureka.score import rank
from openeureka.stats import mean, spearman
from openeureka.store import Store
from openeureka.types import (
    Candidate,
    Evaluation,
    Peak,
    Reply,
    RewardProgram,
    TrainingResult,
    lane_id,
)

REPLIES = FOLDER / "choosing"
RESULTS = results("choosing")
STEPS = {
    "ballbalance": 600_000,
    "quadcopter": 1_500_000,
    "ant": 1_500_000,
    "franka_cabinet": 1_500_000,
    "shadow_hand_over": 1_000_000,
    "shadow_hand_door_open_outward": 600_000,
    "shadow_hand_push_block": 600_000,
}
"""Environment steps of each lane: about as many as the human reward takes to reach something."""
SEEDS = (0, 1, 2)
"""The first is the search's; the others are fresh."""
PEAKS: tuple[Peak, ...] = get_args(Peak)
JUDGED = 9_000_000
"""Seed of the held-out start states: neither a search nor its final scores use it."""

RANKING = (
    *(
        "task",
        "rewards",
        "in training, same policy",
        "played, same policy",
        "in training, fresh seeds",
        "played, fresh seeds",
    ),
    "fresh seeds", "F of the first by training", "the first by playing",
    "the best of the three that race", "the best there was", "human",
)  # fmt: skip
SIZES = (1, 2, 4, 8)
FEWER = ("task", *(f"of {size}" if size > 1 else "a random one" for size in SIZES), "the best there was", "human")
CHECKPOINTS = ("task", "lanes", "peak of F", "peak of own reward", "end of training", "the one that plays best")
RANKED = """*Same policy*: rank correlation with held-out F of the policy that was ranked. *Fresh seeds*: with that of
trainings with other seeds; the last five columns are held-out F over those seeds. Three race, the first by playing.
*The best* of the three, and of all, are picked by the very scores that stand there: no search can count on them.

How many rewards does it take? So many train with one seed, drawn from the eight in all ways, and the one that plays
best is chosen. Held-out F with fresh seeds, mean over the draws:
"""
STANDING = """Which policy should stand for a lane? Held-out F, the mean over all lanes and seeds:
"""


def programs(env: str, store: Store) -> list[tuple[str, RewardProgram]]:
    """The accepted rewards of the task's replies, and the human one."""
    replies = read(REPLIES / f"{env}.json")
    texts = {Candidate.of(extract.program(text) or ""): text for text in replies["replies"]}
    new = [candidate for candidate in texts if store.rewards.verdict(candidate.id) is None]
    for candidate, verdict in zip(new, judge(env, new, unsafe=False), strict=True):
        store.rewards.save_verdict(candidate, verdict, Reply(text=texts[candidate], model=replies["model"]))
    verdicts = {candidate.id: store.rewards.verdict(candidate.id) for candidate in texts}
    found = [(key, verdict.graph) for key, verdict in verdicts.items() if verdict is not None and verdict.graph]
    return [*found, ("human", "human")]


def measure(env: str, seed: int) -> None:
    """Train what is missing of one task and seed, play it, and write it down.

    Raises:
        SystemExit: where the lanes that are known have another recipe.
    """
    entry: Record = read(RESULTS).get(env, {})
    refuse_other_recipe(entry, recipe := whole(env, env_steps=STEPS[env]), env)
    config = RunConfig(env=env, model="replay", steps=STEPS[env], seed=0)
    with comparing(config, OUTPUTS / "choosing" / env, Script()) as lanes:
        store = lanes.store
        rewards = programs(env, store)
        dealt = deal(rewards, [seed], "final" if seed else "candidate")
        wanted = [one for one in dealt if one[0].id not in entry.get("lanes", {})]
        results = lanes.train(wanted)
        replace(lanes, peaks=PEAKS).play(results)
        records: Record = {}
        for lane in results:
            policies = {peak: policy for peak in PEAKS if (policy := store.lanes.policy(lane, peak)) is not None}
            judged = {score.lane: score for score in lanes.trainer.evaluate(env, policies, seed=JUDGED)}
            found = _record(results[lane], store.lanes.plays().get(lane, {}), judged)
            records[lane] = {**found, "trained": machine("cpu")}
        lanes.store.end()
    done = read(RESULTS)  # again: another task may have been measured meanwhile
    known = {**done.get(env, entry).get("lanes", {}), **records}
    write(RESULTS, {**done, env: {"steps": STEPS[env], "recipe": recipe, "lanes": known}})


def _record(
    result: TrainingResult, plays: Mapping[Peak, Sequence[Evaluation]], judged: Mapping[str, Evaluation]
) -> Record:
    def short(score: Evaluation) -> Record:
        return {name: getattr(score, name) for name in ("fitness", "error", "episodes")}

    curve = [value for value in result.curves["fitness"] if value is not None]
    return {
        "training": result.fitness,
        "window": curve[-1] if curve else None,
        "env_steps": result.env_steps,
        "state": result.state,
        "played": {peak: [short(look) for look in looks] for peak, looks in plays.items()},
        "held_out": {peak: short(score) for peak, score in judged.items()},
    }


def ranking(measured: Record) -> list[tuple[str, ...]]:
    """One row per task: rank correlation of F in training, and of F when played, with held-out F of the same policy and
    of fresh trainings; and held-out F in fresh trainings of the reward that each would crown."""
    return [_ranking(env, measured[env]["lanes"]) for env in STEPS if env in measured]


def _ranking(env: str, lanes: Mapping[str, Record]) -> tuple[str, ...]:
    own = _searched(lanes)
    names = list(own)
    training = [own[name]["training"] for name in names]
    played = [_score(own[name], standing(own[name])) for name in names]
    cells = [
        _correlation(training, [own[name]["held_out"]["fitness"]["fitness"] for name in names]),
        _correlation(played, [own[name]["held_out"][standing(own[name])]["fitness"] for name in names]),
    ]
    fresh = {name: _fresh(lanes, name) for name in [*names, "human"]}
    known = [name for name in names if fresh[name] is not None]
    if not known:
        return (env, str(len(names)), *cells, *("-" for _ in range(8)))
    by_training = dict(zip(names, training, strict=True))
    by_played = dict(zip(names, played, strict=True))
    again = [rank(fresh[name]) for name in known]
    cells += [_correlation([by[name] for name in known], again) for by in (by_training, by_played)]
    first = [_best_of([(by[name], fresh[name]) for name in known], 1) for by in (by_training, by_played)]
    racing = _best_of([(by_played[name], fresh[name]) for name in known], CONTENDERS)
    seeds = len(_seeds(lanes, known[0]))
    scores = [*first, racing, max(again), fresh["human"]]
    return (env, str(len(names)), *cells, str(seeds), *map(number, scores))


def _best_of(scored: Sequence[tuple[float | None, float | None]], count: int) -> float | None:
    """The highest fresh F among the `count` that lead by another score. Where too many are level there, the mean over
    all ways to pick among them: nothing tells them apart."""
    last = sorted((rank(by) for by, _ in scored), reverse=True)[:count][-1]
    above = [fresh for by, fresh in scored if rank(by) > last]
    level = [fresh for by, fresh in scored if rank(by) == last]
    return mean([max((*above, *some), key=rank) for some in combinations(level, count - len(above))])


def _searched(lanes: Mapping[str, Record]) -> dict[str, Record]:
    """Records with the search's seed, by reward, without the human one and those that have no score."""
    own = {name: lanes[lane_id(name, SEEDS[0])] for name in generated(lanes)}
    return {name: one for name, one in own.items() if one["held_out"] and one["training"] is not None}


def generated(lanes: Mapping[str, Record]) -> list[str]:
    """All rewards except the human one."""
    return sorted(by_reward(lanes).keys() - {"human"})


def standing(record: Record) -> Peak:
    """The policy that plays best."""
    return max(record["played"], key=lambda peak: _score(record, peak))


def _score(record: Record, peak: Peak) -> float:
    """Played F over all looks."""
    looks = record["played"][peak]
    return sum(look["fitness"] * look["episodes"] for look in looks) / sum(look["episodes"] for look in looks)


def _seeds(lanes: Mapping[str, Record], name: str) -> list[int]:
    """The further seeds that are done."""
    return [seed for seed in SEEDS[1:] if lane_id(name, seed) in lanes]


def _fresh(lanes: Mapping[str, Record], name: str) -> float | None:
    """Held-out F of further trainings, mean over seeds; None where there are none."""
    done = [lanes[lane_id(name, seed)] for seed in _seeds(lanes, name)]
    return mean([one["held_out"][standing(one)]["fitness"] for one in done if one["held_out"]])


def _correlation(xs: Sequence[float], ys: Sequence[float]) -> str:
    """Spearman's rank correlation; a dash where one side is constant."""
    found = spearman(xs, ys)
    return "-" if found is None else f"{found:.2f}"


def fewer(measured: Record) -> list[tuple[str, ...]]:
    """One row per task with fresh seeds: F of the reward chosen from 1, 2, 4 or 8, mean over all ways to draw them."""
    known = {env: measured[env]["lanes"] for env in STEPS if env in measured}
    return [_fewer(env, lanes) for env, lanes in known.items() if _fresh(lanes, "human") is not None]


def _fewer(env: str, lanes: Mapping[str, Record]) -> tuple[str, ...]:
    """The reward that plays best with the search's seed is chosen, and judged by held-out F with fresh seeds. Rewards
    that play alike are judged by their mean."""
    played = {name: _score(one, standing(one)) for name, one in _searched(lanes).items()}
    again = {name: score for name in played if (score := _fresh(lanes, name)) is not None}
    fresh = [
        mean([again[other] for other in again if played[other] == played[name]]) or 0.0
        for name in sorted(again, key=lambda name: -played[name])
    ]
    found = [
        sum(comb(len(fresh) - 1 - place, size - 1) * value for place, value in enumerate(fresh))
        / comb(len(fresh), size)
        for size in (one for one in SIZES if one <= len(fresh))
    ]
    return (env, *map(number, found), number(max(again.values())), number(_fresh(lanes, "human")))


def checkpoints(measured: Record) -> list[tuple[str, ...]]:
    """One row per task: held-out F by the policy that stands for a lane, mean over all lanes of all seeds."""
    rows = []
    for env in (env for env in STEPS if env in measured):
        lanes = [one for one in measured[env]["lanes"].values() if set(one["held_out"]) == set(PEAKS)]
        means = [mean([one["held_out"][peak]["fitness"] for one in lanes]) for peak in PEAKS]
        best = mean([one["held_out"][standing(one)]["fitness"] for one in lanes])
        rows.append((env, str(len(lanes)), *map(number, [*means, best])))
    return rows


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=STEPS, nargs="+", default=list(STEPS))
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    options = parser.parse_args()
    for seed in options.seeds:
        for env in options.env:
            print(f"{env}, seed {seed}", flush=True)
            measure(env, seed)
