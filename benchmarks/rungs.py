"""How far is a training after a share of its steps, and does that tell where it ends? Its policy plays on the way.

    python benchmarks/rungs.py --env ant --rewards human                         # with the task's recipe
    python benchmarks/rungs.py --env ant --rewards human --worlds 64 --horizon 32
    python benchmarks/rungs.py --env ant --worlds 64 --horizon 32                # a strong model's rewards as well
    make docs                                                                    # docs/reference/measurements.md

Each lane is one training. At each rung its policy of that moment plays, as in a search, but on other start states.
What is done is in `benchmarks/results/rungs.json` and is not repeated; lanes are trained in parts, each written when it
is done.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any
from unittest.mock import patch

import choosing
import torch
from lanes import by_reward, rounded
from ledger import DEFAULTS, in_sentences, refuse_other_recipe, whole
from predictors import window
from records import FOLDER, Record, command_line, machine, read, results, write

from openeureka.numbers import number
from openeureka.reward import extract
from openeureka.runs.rewards import judge
from openeureka.score import rank
from openeureka.stats import mean, spearman
from openeureka.tasks import registry
from openeureka.training.evaluate import evaluate
from openeureka.training.policy import Policy
from openeureka.training.population import Population
from openeureka.types import Candidate, LaneSpec, RewardProgram, TrainBudget, TrainingResult, lane_id

RESULTS = results("rungs")
RUNGS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 3 / 4, 1.0)
STEPS = {
    "cartpole": 600_000,
    "anymal": 1_000_000,
    "humanoid": 3_000_000,
    "shadow_hand_catch_over2underarm": 1_000_000,
    **choosing.STEPS,
}
"""Environment steps of each lane."""
EPISODES = 32
"""Episodes of each policy and rung."""
SEED = 7_000_000
"""Seed of the start states; no search and no final score uses it."""
RECIPE = {"worlds": int, "horizon": int, "epochs": int, "minibatches": int, "noise": float, "head": float}
"""What may differ from the task's recipe."""
TOGETHER = 4
"""Lanes of a simulation."""


class Watched(Population):
    """A population that keeps its policies at the rungs."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.ends = [max(1, round(share * self.epochs)) for share in RUNGS]
        self.kept: dict[tuple[int, int], bytes] = {}

    def _checkpoint(self, epoch: int) -> None:
        super()._checkpoint(epoch)
        for rung in (rung for rung, end in enumerate(self.ends) if end == epoch + 1):
            for lane, active in enumerate(self.ppo.active.tolist()):
                if active:
                    self.kept[lane, rung] = Policy.of(self.env_name, self.ppo, lane, self.interface).to_bytes()


def accepted(env: str, replies: Iterable[str]) -> dict[str, RewardProgram]:
    """The rewards in these replies that the sandbox accepts, by id."""
    return {candidate.id: graph for candidate, graph in judged(env, replies)}


def judged(env: str, replies: Iterable[str]) -> Iterator[tuple[Candidate, RewardProgram]]:
    """The programs in these replies that the sandbox accepts, and the graphs of them."""
    candidates = [Candidate.of(extract.program(text) or "") for text in replies]
    for candidate, verdict in zip(candidates, judge(env, candidates, unsafe=False), strict=True):
        if verdict.graph is not None:
            yield candidate, verdict.graph


def programs(env: str) -> dict[str, RewardProgram]:
    """The accepted rewards among a strong model's replies to the first prompt of a search, and the human one."""
    path = FOLDER / "choosing" / f"{env}.json"
    if not path.exists():
        print(f"{env} has no replies in {path.parent}: the human reward trains alone.", flush=True)
        return {"human": "human"}
    return {"human": "human", **accepted(env, read(path)["replies"])}


def train(env: str, lanes: Sequence[LaneSpec], steps: int, recipe: Mapping[str, float]) -> Record:
    """Records of these lanes."""
    torch.set_num_threads(1)
    task = registry.get(env)
    with patch.object(task, "recipe", dataclasses.replace(task.recipe, **recipe)):
        begun = time.process_time()
        population = Watched(env, lanes, TrainBudget(env_steps=steps), threads=1)
        results = [message for message in population.train() if isinstance(message, TrainingResult)]
        seconds = (time.process_time() - begun) / len(lanes)
    places = {f"{lane} {rung}": (lane, rung) for lane, rung in population.kept}
    policies = {key: population.kept[place] for key, place in places.items()}
    scores = {places[s.lane]: s for s in evaluate(env, policies, seed=SEED, episodes=EPISODES, threads=1)}
    return {
        spec.id: {
            "cpu_s": round(seconds, 1),
            "message": result.message,
            "window": [rounded(window(result.curves["fitness"], end)) for end in population.ends],
            "played": [rounded(scores[lane, r].fitness) if (lane, r) in scores else None for r in range(len(RUNGS))],
            "error": [rounded(scores[lane, r].error) if (lane, r) in scores else None for r in range(len(RUNGS))],
        }
        for lane, (spec, result) in enumerate(zip(lanes, results, strict=True))
    }


def missing(
    rewards: Mapping[str, RewardProgram], seeds: Sequence[int], known: Mapping[str, object]
) -> Iterator[Sequence[LaneSpec]]:
    """The lanes that have no record, in parts of a few lanes that give work to every core."""
    specs = [LaneSpec(id=lane_id(key, seed), program=rewards[key], seed=seed) for seed in seeds for key in rewards]
    lanes = [spec for spec in specs if spec.id not in known]
    size = max(1, min(TOGETHER, -(-len(lanes) // len(os.sched_getaffinity(0)))))
    yield from (lanes[start : start + size] for start in range(0, len(lanes), size))


def side_by_side(
    env: str,
    parts: Iterable[Sequence[LaneSpec]],
    steps: int,
    recipe: Mapping[str, float],
    keep: Callable[[Record], object],
) -> None:
    """Train parts, one per core; records are kept as they come."""
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(train, env, part, steps, recipe) for part in parts]):
            keep(done.result())


def measure(
    env: str,
    rewards: Mapping[str, RewardProgram],
    seeds: Sequence[int],
    recipe: Mapping[str, float],
    steps: int,
) -> None:
    """Train what is missing, and write each part down.

    Raises:
        SystemExit: where a row of this name has another recipe.
    """
    trained = whole(env, **recipe, env_steps=steps)
    updates = "".join(f"{recipe[word]} {word}, " for word in ("epochs", "minibatches") if word in recipe)
    # Also where they are the task's own, which may change later.
    others = {word: trained[word] for word in ("noise", "head") if trained[word] != DEFAULTS[word]}
    updates += "".join(f"{word} {value:g}, " for word, value in others.items())
    name = f"{trained['worlds']} x {trained['horizon']}, {updates}{steps:,} steps"
    known = read(RESULTS).get(env, {}).get(name, {})
    refuse_other_recipe(known, trained, f"{env}, {name},")

    def keep(records: Record) -> None:
        found = read(RESULTS)
        own = found.setdefault(env, {}).setdefault(name, {"steps": steps, "recipe": trained, "lanes": {}})
        own["lanes"] |= {lane: {**record, "trained": machine("cpu")} for lane, record in records.items()}
        write(RESULTS, found)
        for lane, record in records.items():
            print(env, name, lane, record["played"], record["window"], record["cpu_s"], flush=True)

    parts = missing(rewards, seeds, known.get("lanes", {}))
    side_by_side(env, parts, steps, recipe, keep)


# --- what it says ----------------------------------------------------------------------------------------------------

SOON = ("task", "worlds x horizon, steps", "seeds", "after 1/16", "1/8", "1/4", "1/2", "3/4", "at the end")
FRESH = "fresh seeds"
TELLING = ("task", "worlds x horizon, steps", "ends as", "after 1/16", "1/8", "1/4", "1/2", "3/4", "at the end")


def soon(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task and recipe: what the human reward's policy plays at the rungs, mean over seeds."""
    rows = []
    for env, recipes in study.items():
        for name, found in sorted(recipes.items(), key=lambda item: item[1]["steps"]):
            own = [lane["played"] for key, lane in found["lanes"].items() if key.startswith("human-s")]
            rows.append((env, name, str(len(own)), *(number(mean(at), 3) for at in zip(*own, strict=True))))
    return rows


def telling(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """Two rows per task, as text."""
    return [(*names, *(number(cell, 2) for cell in cells)) for *names, cells in correlations(study)]


def summary(study: Mapping[str, Record]) -> str:
    """How high the rank correlations with the ends of other seeds come."""
    fresh = [cells for _, _, title, cells in correlations(study) if title == FRESH]

    def most(rungs: Iterable[int]) -> str:
        return number(max(rank(cells[rung]) for cells in fresh for rung in rungs), 2)

    whole = [rank(cells[-1]) for cells in fresh]
    return (
        f"The rank correlation with the final scores of other seeds is at most {most((0, 1))} for the first two rungs, "
        f"at most {most(range(2, len(RUNGS) - 1))} for the later ones, and {number(min(whole), 2)} to "
        f"{number(max(whole), 2)} for whole trainings."
    )


def correlations(study: Mapping[str, Record]) -> list[tuple[str, str, str, list[float | None]]]:
    """Two rows per task: rank correlation of what lanes play at a rung with what they play at the end, and with what
    other seeds of the same rewards play at the end; mean over seeds."""
    rows = []
    for env, name, scores in studied(study):
        for title, fresh in (("same lane", False), (FRESH, True)):
            cells = [
                mean([_tells(scores, seed, rung, fresh) for seed in common_seeds(scores)]) for rung in range(len(RUNGS))
            ]
            rows.append((env, name, title, cells))
    return rows


Played = dict[str, dict[int, Sequence[float | None]]]
"""What policies play at the rungs, by reward and seed."""


def studied(study: Mapping[str, Record]) -> Iterator[tuple[str, str, Played]]:
    """Task, recipe and scores of those that trained more than the human reward."""
    for env, recipes in study.items():
        for name, found in recipes.items():
            scores: Played = by_reward({lane: one["played"] for lane, one in found["lanes"].items()})
            scores.pop("human", None)
            if len(scores) > 1:
                yield env, name, scores


def common_seeds(scores: Played) -> list[int]:
    """The seeds that every reward trained with."""
    return sorted(set.intersection(*(set(of) for of in scores.values())))


def worth(scores: Played, reward: str, but: int, standing: Callable[[Sequence[float | None]], float | None]) -> float:
    """Mean F that a reward's policies play, over trainings with seeds other than `but`; `standing` picks the policy."""
    return rank(mean([standing(scores[reward][seed]) for seed in common_seeds(scores) if seed != but]))


def final(played: Sequence[float | None]) -> float | None:
    return played[-1]


def best(played: Sequence[float | None]) -> float | None:
    return max((score for score in played if score is not None), default=None)


def _tells(scores: Played, seed: int, rung: int, fresh: bool) -> float | None:
    now = [rank(of[seed][rung]) for of in scores.values()]
    end = [worth(scores, reward, seed, final) if fresh else rank(final(of[seed])) for reward, of in scores.items()]
    return spearman(now, end)


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=STEPS, nargs="+", default=list(STEPS))
    parser.add_argument("--rewards", choices=("human", "all"), default="all")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--steps", type=int, default=0, help="of each lane, instead of those above")
    for name, kind in RECIPE.items():
        parser.add_argument(f"--{name}", type=kind, default=0, help="instead of the recipe's")
    options = parser.parse_args()
    recipe = {name: value for name in RECIPE if (value := getattr(options, name))}
    for env in options.env:
        human: dict[str, RewardProgram] = {"human": "human"}
        with in_sentences():
            rewards = programs(env) if options.rewards == "all" else human
        measure(env, rewards, options.seeds, recipe, options.steps or STEPS[env])


if __name__ == "__main__":
    main()
