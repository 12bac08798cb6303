"""Does a piece of advice in the prompt make better rewards? Replies with it and without it train side by side.

    python benchmarks/prompts.py                       # what is missing; writes benchmarks/results/prompts.json
    python benchmarks/prompts.py --env ant --seeds 0 1
    make docs                                          # the table in docs/reference/measurements.md

`benchmarks/prompts/TASK.json` holds a strong model's replies to the first prompt of a search, by the advice in that
prompt, and the words of each advice. All train alike, in the way that learns soonest (see
docs/reference/measurements.md). What counts is F of the last policy when it plays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from statistics import stdev

import rungs
from lanes import by_reward, reward_and_seed
from ledger import differing, whole
from records import FOLDER, Record, command_line, machine, read, results, write
from scipy.stats import ttest_ind

from openeureka.numbers import number
from openeureka.stats import CONFIDENCE, defined, mean
from openeureka.types import RewardProgram, lane_id

REPLIES = FOLDER / "prompts"
RESULTS = results("prompts")
STEPS = {"ant": 750_000, "anymal": 750_000, "ballbalance": 300_000}
"""Environment steps of each lane."""
SEEDS = (0, 1)
RECIPES: Mapping[str, Mapping[str, float]] = {
    "ant": {"worlds": 128, "noise": 0.4},
    "anymal": {"noise": 0.4},
    "ballbalance": {"worlds": 64, "horizon": 32, "noise": 0.4},
}
"""What differs from the task's recipe, see docs/reference/measurements.md."""
TITLES = (
    "task", "advice", "accepted", "trainings", "F, mean over rewards ± standard error",
    "the best reward", "the human one",
)  # fmt: skip


def measure(env: str, seed: int) -> None:
    """Train what is missing of one task and seed, and write it down. Lanes of another recipe count as missing."""
    replies = read(REPLIES / f"{env}.json")["replies"]
    rewards = {advice: rungs.accepted(env, texts) for advice, texts in replies.items()}
    graphs: dict[str, RewardProgram] = {"human": "human"}
    for own in rewards.values():
        graphs |= own

    def keep(records: Record) -> None:
        trained = {"recipe": recipe(env), **machine("cpu")}
        found = read(RESULTS)
        own = found.setdefault(env, {"lanes": {}})
        own["rewards"] = {name: list(ids) for name, ids in rewards.items()}
        own["lanes"] |= {lane: {"fitness": one["played"][-1], "trained": trained} for lane, one in records.items()}
        write(RESULTS, found)

    parts = rungs.missing(graphs, [seed], current(env, read(RESULTS).get(env, {})))
    rungs.side_by_side(env, parts, STEPS[env], RECIPES[env], keep)


def recipe(env: str) -> Record:
    """The whole recipe that lanes of a task train with now."""
    return whole(env, **RECIPES[env], env_steps=STEPS[env])


def current(env: str, own: Record) -> Record:
    """Lanes with this recipe: a task's own may have changed since others trained."""
    now = recipe(env)
    return {lane: one for lane, one in own.get("lanes", {}).items() if not differing(one["trained"]["recipe"], now)}


def left(study: Mapping[str, Record]) -> Iterator[tuple[str, int]]:
    """Task and seed of what is missing."""
    for seed in SEEDS:
        for env in STEPS:
            own = study.get(env, {})
            rewards = [reward for ids in own.get("rewards", {}).values() for reward in ids]
            wanted = {lane_id(reward, seed) for reward in ("human", *rewards)}
            if not rewards or wanted - current(env, own).keys():
                yield env, seed


def rows(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task and advice: F over its rewards, each the mean over its seeds; the error is that over rewards."""
    found = []
    for env, own in study.items():
        lanes = _lanes(own)
        older = [reward_and_seed(lane)[0] for lane in own["lanes"].keys() - current(env, own).keys()]
        for advice, ids in own["rewards"].items():
            scores = _scores(lanes, ids)
            error = stdev(scores) / len(scores) ** 0.5
            trainings = str(sum(len(lanes.get(key, ())) for key in ids))
            if before := sum(reward in ids for reward in older):
                trainings += f", {before} with an older recipe"
            cells = (f"{number(mean(scores))} ± {number(error, 2)}", number(max(scores)), number(mean(lanes["human"])))
            found.append((env, advice, str(len(ids)), trainings, *cells))
    return found


def summary(study: Mapping[str, Record]) -> str:
    """Whether advice makes a difference on any task, and how large it is compared with its error (Student's test).
    Several tasks are asked, so each takes more (Bonferroni)."""
    told, sure = "", False
    for env, own in study.items():
        found = ttest_ind(*(_scores(_lanes(own), ids) for ids in own["rewards"].values()))
        sure = sure or found.pvalue < (1 - CONFIDENCE) / len(STEPS)
        told += (
            f" On {env} the difference is {abs(found.statistic):.1f} times its standard error (p = {found.pvalue:.2g})."
        )
    asked = f"{len(STEPS)} tasks are asked, so it takes p below {(1 - CONFIDENCE) / len(STEPS):.2g}"
    return f"{'A difference is shown' if sure else 'No difference is shown'}: {asked}.{told}"


def _lanes(own: Record) -> dict[str, list[float]]:
    """F of every seed by reward."""
    lanes = by_reward(own["lanes"])
    found = {reward: defined(one["fitness"] for one in seeds.values()) for reward, seeds in lanes.items()}
    return {reward: scores for reward, scores in found.items() if scores}


def _scores(lanes: Mapping[str, list[float]], rewards: Iterable[str]) -> list[float]:
    """F of each reward that trained, mean over its seeds."""
    return [mean(lanes[reward]) or 0.0 for reward in rewards if reward in lanes]


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=STEPS, nargs="+", default=list(STEPS))
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    options = parser.parse_args()
    for seed in options.seeds:
        for env in options.env:
            measure(env, seed)
            for row in rows(read(RESULTS)):
                print(*row, sep="  ", flush=True)
