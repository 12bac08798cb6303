"""What the human and the sparse reward of each task learn on this machine: curves, held-out scores, steps and minutes.

    python benchmarks/learning.py                              # all these tasks, two seeds; hours on 2 cores
    python benchmarks/learning.py --env ant --steps 8e6        # one task, other budget

Each task's result is written when it is done (`benchmarks/results/learning_<env>.json`), so a broken-off run loses one.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from openeureka.tasks import registry
from openeureka.training.executor import PopulationTrainer
from openeureka.types import TrainBudget, TrainingProgress, TrainingResult, TrainJob

RESULTS = Path(__file__).parent / "results"
TASKS = ("cartpole", "ballbalance", "quadcopter", "ant", "humanoid", "anymal", "franka_cabinet")
REWARDS = ("human", "sparse")
POINTS = 40  # of each curve in the file


def learn(env: str, rewards: Sequence[str], seeds: int, budget: TrainBudget) -> dict[str, Any]:
    """Train every reward with every seed as lanes of one population, then score the peaks of F on held-out episodes."""
    jobs = [
        TrainJob(id=f"{reward}-s{seed}", program=reward, seed=seed)  # pyright: ignore[reportArgumentType]
        for reward in rewards
        for seed in range(seeds)
    ]
    trainer = PopulationTrainer()
    started = time.perf_counter()
    results: dict[str, TrainingResult] = {}
    for message in trainer.train(env, jobs, budget):
        if isinstance(message, TrainingProgress):
            best = ", ".join(f"{job} {value:.3g}" for job, value in message.fitness.items() if value is not None)
            print(f"\r{env} epoch {message.epoch}/{message.epochs}: {best}\033[K", end="", flush=True)
        else:
            results[message.job] = message
    minutes = (time.perf_counter() - started) / 60
    policies = {job: result.best_fitness.policy for job, result in results.items() if result.best_fitness}
    held_out = {score.job: score for score in trainer.evaluate(env, policies, seed=0)}
    recipe = registry.get(env).recipe
    print()
    return {
        "env": env,
        "date": datetime.now(UTC).date().isoformat(),
        "device": f"{os.cpu_count()} cores, {platform.machine()}",
        "versions": {name: version(name) for name in ("torch", "mujoco")},
        "lanes": len(jobs),
        "worlds_per_lane": budget.worlds or recipe.worlds,
        "env_steps_per_lane": next(iter(results.values())).env_steps,
        "minutes": round(minutes, 1),
        "recipe": dataclasses.asdict(recipe),
        "results": {
            job: {
                "state": result.state,
                "fitness_max_over_epochs": result.fitness,
                "fitness_held_out": held_out[job].fitness if job in held_out else None,
                "episode_length_held_out": held_out[job].episode_length if job in held_out else None,
                "correlation_with_human": result.correlation,
                "curves": thinned(result.curves),
            }
            for job, result in results.items()
        },
    }


def thinned(curves: Mapping[str, Sequence[float | None]]) -> dict[str, list[float | None]]:
    """Evenly spaced points of the curves that tell the story."""
    shown = {name: curves[name] for name in ("fitness", "episode_length", "reward") if name in curves}
    return {
        name: [None if value is None else round(value, 4) for value in curve[:: max(1, len(curve) // POINTS)]]
        for name, curve in shown.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--reward", default=",".join(REWARDS), help="human, sparse or both")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--steps", type=float, default=0, help="environment steps of a lane, 0 for the recipe's")
    parser.add_argument("--worlds", type=int, default=0, help="worlds of a lane, 0 for the recipe's")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    budget = TrainBudget(env_steps=int(options.steps), worlds=options.worlds)
    for env in options.env or TASKS:
        found = learn(env, options.reward.split(","), options.seeds, budget)
        options.out.mkdir(parents=True, exist_ok=True)
        path = options.out / f"learning_{env}.json"
        path.write_text(json.dumps(found, indent=1) + "\n")
        for job, result in found["results"].items():
            print(f"{env} {job}: F {result['fitness_max_over_epochs']}, held out {result['fitness_held_out']}")
        print(f"{path}: {found['minutes']} minutes")


if __name__ == "__main__":
    main()
