"""Does a piece of advice in the prompt make better rewards? Replies with it and without it train side by side.

    python benchmarks/prompts.py                       # what is missing; writes benchmarks/results/prompts.json
    python benchmarks/prompts.py --env ant --seeds 0 1
    make docs                                          # the table in docs/concepts/loop.md

`benchmarks/prompts/TASK.json` holds a strong model's replies to the first prompt of a search, by the advice that this
held, and the words of each. All train alike, in the way that learns soonest (see docs/concepts/schedule.md). What
counts is F of the last policy when it plays.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from statistics import stdev
from typing import Any

import rungs
from records import read, today, write

from openeureka.report.text import number
from openeureka.reward import extract
from openeureka.sandbox.client import Sandbox
from openeureka.score import mean
from openeureka.tasks.context import context
from openeureka.tasks.record import record_states
from openeureka.types import Candidate, LaneSpec, RewardProgram, lane_id

FOLDER = Path(__file__).parent
REPLIES = FOLDER / "prompts"
RESULTS = FOLDER / "results" / "prompts.json"
STEPS = {"ant": 750_000, "anymal": 750_000, "ballbalance": 300_000}
"""Of each lane."""
RECIPES: Mapping[str, Mapping[str, int]] = {
    "ant": {"worlds": 128},
    "anymal": {},
    "ballbalance": {"worlds": 64, "horizon": 32},
}
"""What is other than in the task's recipe."""
MANNER = {"noise": 0.4}
"""Less noise in the first actions, as in docs/concepts/schedule.md."""
TITLES = ("task", "advice", "accepted", "trainings", "F, mean over rewards", "the best reward", "the human one")

Record = dict[str, Any]


def programs(env: str) -> dict[str, dict[str, RewardProgram]]:
    """The accepted rewards by the advice that their prompt held."""
    replies = json.loads((REPLIES / f"{env}.json").read_text())["replies"]
    found: dict[str, dict[str, RewardProgram]] = {}
    with Sandbox(context(env).state, record_states(env)) as checker:
        for advice, texts in replies.items():
            for text in texts:
                candidate = Candidate.of(extract.program(text) or "")
                graph = checker.check(candidate).graph
                if graph is not None:
                    found.setdefault(advice, {})[candidate.id] = graph
    return found


def measure(env: str, seed: int) -> None:
    """Train what is missing of one task and seed, and write it down."""
    rewards = programs(env)
    graphs: dict[str, RewardProgram] = {"human": "human"}
    for own in rewards.values():
        graphs |= own
    known = read(RESULTS).get(env, {}).get("lanes", {})
    specs = [LaneSpec(id=lane_id(key, seed), program=graphs[key], seed=seed) for key in graphs]
    missing = [spec for spec in specs if spec.id not in known]
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=get_context("spawn")) as pool:
        parts = [pool.submit(rungs.train, env, part, STEPS[env], RECIPES[env], MANNER) for part in rungs.parts(missing)]
        for done in as_completed(parts):
            found = read(RESULTS)
            own = found.setdefault(env, {"lanes": {}})
            own |= {"steps": STEPS[env], "date": today(), "rewards": {name: list(ids) for name, ids in rewards.items()}}
            own["lanes"] |= {lane: record["played"][-1] for lane, record in done.result().items()}
            write(RESULTS, found)


def table(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """A row a task and advice: F over its rewards, each the mean over its seeds; the error is that over rewards."""
    rows = []
    for env, own in study.items():
        lanes: dict[str, list[float]] = {}
        for lane, score in own["lanes"].items():
            if score is not None:
                lanes.setdefault(lane.rpartition("-s")[0], []).append(score)
        for advice, ids in own["rewards"].items():
            scores = [mean(lanes[key]) or 0.0 for key in ids if key in lanes]
            error = stdev(scores) / len(scores) ** 0.5
            trainings = sum(len(lanes.get(key, ())) for key in ids)
            cells = (f"{number(mean(scores))} ± {number(error, 2)}", number(max(scores)), number(mean(lanes["human"])))
            rows.append((env, advice, str(len(ids)), str(trainings), *cells))
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", choices=STEPS, nargs="+", default=list(STEPS))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    options = parser.parse_args()
    for seed in options.seeds:
        for env in options.env:
            measure(env, seed)
            for row in table(read(RESULTS)):
                print(*row, sep="  ", flush=True)
