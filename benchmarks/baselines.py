"""What the human and the sparse reward of every task reach: the two ends of the human-normalised score.

    python benchmarks/baselines.py                               # all tasks, three seeds; hours on 2 cores
    python benchmarks/baselines.py --env ant --seeds 5           # one task; seeds that are there are not trained again
    python benchmarks/baselines.py --env ant --device cuda       # on all GPUs
    python benchmarks/baselines.py --reward human --threads 1    # beside another such process, on other tasks

The rewards and seeds of a task are lanes of one training. `benchmarks/results/baselines.json` is written after each
task, and what it holds is not repeated; a training that is broken off leaves its state: the same command goes on. The
package ships its summary (`src/openeureka/suite/baselines.json`): `eureka envs` shows it, and scores read it where the
human and the sparse reward were not trained along.
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

import torch

from openeureka.executors.local import LocalExecutor
from openeureka.tasks import registry
from openeureka.types import Evaluation, LaneSpec, TrainBudget, Trainer, TrainingProgress, TrainingResult

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "baselines.json"
SNAPSHOTS = ROOT / "benchmarks" / "results" / "snapshots"
SHIPPED = ROOT / "src" / "openeureka" / "suite" / "baselines.json"
REWARDS = ("human", "sparse")
PEAKS = ("fitness", "reward")
POINTS = 40  # of each curve in the file

Record = dict[str, Any]


def missing(entry: Record, seeds: int, rewards: Sequence[str] = REWARDS) -> list[LaneSpec]:
    """Lanes of a task that its record does not hold."""
    specs = [
        LaneSpec(id=f"{reward}-s{seed}", program=reward, seed=seed)  # pyright: ignore[reportArgumentType]
        for reward in rewards
        for seed in range(seeds)
    ]
    return [spec for spec in specs if spec.id not in entry["lanes"]]


def settings(env: str, budget: TrainBudget) -> Record:
    """What a number depends on beside its reward and seed."""
    recipe = registry.get(env).recipe
    return {
        "env_steps": budget.env_steps or recipe.env_steps,
        "worlds": budget.worlds or recipe.worlds,
        "recipe": {**dataclasses.asdict(recipe), "hidden": list(recipe.hidden)},
    }


def learn(env: str, specs: Sequence[LaneSpec], budget: TrainBudget, device: str, threads: int) -> Record:
    """Train the lanes and score the peaks of F on held-out episodes; one record a lane."""
    trainer = LocalExecutor(device, threads, snapshots=SNAPSHOTS)
    started = time.perf_counter()
    results: list[TrainingResult] = []
    for message in trainer.train(env, specs, budget):
        if isinstance(message, TrainingProgress):
            best = ", ".join(f"{lane} {value:.3g}" for lane, value in message.fitness.items() if value is not None)
            print(f"\r{env} epoch {message.epoch}/{message.epochs}: {best}\033[K", end="", flush=True)
        else:
            results.append(message)
    print()
    minutes = (time.perf_counter() - started) / 60
    used = {"threads": threads} if threads else {}
    training = {"lanes": len(specs), **used, "minutes": round(minutes, 2), **machine(device)}
    return {lane: {**found, "training": training} for lane, found in scored(env, results, trainer).items()}


def scored(env: str, results: Sequence[TrainingResult], trainer: Trainer) -> Record:
    """Each lane's result as JSON, with the held-out scores of both its policies.

    F at first is that of the first episodes that end: of a policy that has hardly trained, exploring.
    """
    at_fitness = {result.lane: result.best_fitness.policy for result in results if result.best_fitness}
    at_reward = {result.lane: result.best_reward.policy for result in results if result.best_reward}
    by_fitness, by_reward = (
        {score.lane: score for score in trainer.evaluate(env, policies, seed=0)} for policies in (at_fitness, at_reward)
    )
    return {
        result.lane: {
            "state": str(result.state),
            "message": result.message,
            "env_steps": result.env_steps,
            "fitness_at_first": next((f for f in result.curves.get("fitness", ()) if f is not None), None),
            "fitness_max_over_epochs": result.fitness,
            "held_out_at_peak_of_fitness": _score(by_fitness.get(result.lane)),
            "held_out_at_peak_of_reward": _score(by_reward.get(result.lane)),
            "correlation_with_human": result.correlation,
            "curves": thinned(result.curves),
        }
        for result in results
    }


def _score(held_out: Evaluation | None) -> Record:
    return {
        "fitness": held_out.fitness if held_out else None,
        "episode_length": held_out.episode_length if held_out else None,
    }


def machine(device: str) -> Record:
    """Where and when, for the record."""
    cores = f"{len(os.sched_getaffinity(0))} cores, {platform.machine()}"
    return {
        "device": torch.cuda.get_device_name(device.split(",")[0]) if device.startswith("cuda") else cores,
        "date": datetime.now(UTC).date().isoformat(),
        "versions": {name: version(name) for name in ("torch", "mujoco")},
    }


def thinned(curves: Mapping[str, Sequence[float | None]]) -> dict[str, list[float | None]]:
    """Evenly spaced points of the curves that tell the story."""
    shown = {name: curves[name] for name in ("fitness", "episode_length", "reward") if name in curves}
    return {
        name: [None if value is None else round(value, 4) for value in curve[:: max(1, -(-len(curve) // POINTS))]]
        for name, curve in shown.items()
    }


def summary(found: Record) -> Record:
    """What the package ships: F of every seed, and what it was measured with."""
    return {env: _summarised(entry) for env, entry in sorted(found.items()) if entry["lanes"]}


def _summarised(entry: Record) -> Record:
    lanes: Record = entry["lanes"]
    trainings = [lane["training"] for lane in lanes.values()]

    def arm(reward: str) -> Record:
        seeds = [lanes[name] for name in sorted(lanes, key=_place) if name.startswith(f"{reward}-")]
        return {
            "training": [lane["fitness_max_over_epochs"] for lane in seeds],
            "held_out": {peak: [lane[f"held_out_at_peak_of_{peak}"]["fitness"] for lane in seeds] for peak in PEAKS},
        }

    return {
        **{reward: arm(reward) for reward in REWARDS},
        "env_steps": entry["env_steps"],
        "worlds": entry["worlds"],
        "device": ", ".join(sorted({training["device"] for training in trainings})),
        "date": max(training["date"] for training in trainings),
    }


def _place(name: str) -> tuple[str, int]:
    """Reward, then seed as a number."""
    reward, _, seed = name.rpartition("-s")
    return reward, int(seed)


def read(path: Path) -> Record:
    return json.loads(path.read_text()) if path.exists() else {}


def write(path: Path, content: Record) -> None:
    """Replace the file whole, so that a broken-off run leaves the old or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(content, indent=1) + "\n")
    temporary.replace(path)


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--reward", action="append", choices=REWARDS, help="one of the two; may be repeated")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=float, default=0, help="environment steps of a lane, 0 for the recipe's")
    parser.add_argument("--worlds", type=int, default=0, help="worlds of a lane, 0 for the recipe's")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="forget what is known of these tasks")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--shipped", type=Path, default=SHIPPED, help="where the package's summary is written")
    options = parser.parse_args(words)
    budget = TrainBudget(env_steps=int(options.steps), worlds=options.worlds)
    for env in options.env or registry.names():
        found = read(options.out)
        wanted = settings(env, budget)
        entry = {**wanted, "lanes": {}} if options.again else found.get(env, {**wanted, "lanes": {}})
        differing = [key for key in wanted if entry[key] != wanted[key]]
        if differing:
            raise SystemExit(f"{options.out} holds {env} with another {' and '.join(differing)}; --again replaces it.")
        specs = missing(entry, options.seeds, options.reward or REWARDS)
        if not specs:
            print(f"{env}: all is known")
            continue
        learned = learn(env, specs, budget, options.device, options.threads)
        # What diverged is a result, and what died with its worker is none.
        lanes = entry["lanes"] | {name: lane for name, lane in learned.items() if lane["state"] != "failed"}
        entry["lanes"] = {name: lanes[name] for name in sorted(lanes, key=_place)}
        found = dict(sorted({**read(options.out), env: entry}.items()))  # others may have written
        write(options.out, found)
        write(options.shipped, summary(found))
        for name, lane in learned.items():
            held_out = lane["held_out_at_peak_of_fitness"]["fitness"]
            first, best = lane["fitness_at_first"], lane["fitness_max_over_epochs"]
            print(f"{env} {name}: F at first {first}, at best {best}, held out {held_out} {lane['message']}".rstrip())


if __name__ == "__main__":
    main()
