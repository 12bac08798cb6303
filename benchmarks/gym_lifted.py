"""How much faster Gymnasium's MuJoCo environments step on lanes than in Gymnasium's own vector environment.

    python benchmarks/gym_lifted.py            all ten, about five minutes
    python benchmarks/gym_lifted.py Ant        some of them; only their rows are replaced

Both sides step under random actions, with observations, rewards and resets, in turn and several times: the ratio is of
medians of one run. Lanes take all cores. Gymnasium's side is its `SyncVectorEnv` with as many worlds in one process, so
on one core, or its `AsyncVectorEnv` with an environment a core; the faster one counts. The ratio per core compares one
core of the lanes with the `SyncVectorEnv`. Writes benchmarks/results/gym_lifted.json.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import torch
from records import Record, command_line, conditions, keep, results

from openeureka.tasks import registry

NAMES = (
    "Hopper", "Walker2d", "HalfCheetah", "Ant", "Humanoid", "Swimmer",
    "Reacher", "Pusher", "InvertedPendulum", "InvertedDoublePendulum",
)  # fmt: skip
ROUNDS = 3
WORLDS = 256
RESULTS = results("gym_lifted")
TITLES = ("environment", "on lanes, steps/s", "Gymnasium, steps/s", "ratio", "ratio per core")


def lifted(name: str, worlds: int, steps: int) -> float:
    """Environment steps a second on lanes."""
    simulation = registry.make(f"gym:{name}-v5", worlds=worlds)
    simulation.reset()
    generator = torch.Generator().manual_seed(0)
    shape = (worlds, simulation.task.num_actions)

    def step() -> None:
        simulation.step(torch.rand(shape, generator=generator) * 2.0 - 1.0)

    return _rate(step, worlds, steps)


def vector(name: str, worlds: int, steps: int, mode: str) -> float:
    """Environment steps a second of Gymnasium."""
    vector: Any = gymnasium.make_vec(f"{name}-v5", num_envs=worlds, vectorization_mode=mode)
    try:
        vector.reset(seed=0)
        vector.action_space.seed(0)
        return _rate(lambda: vector.step(vector.action_space.sample()), worlds, steps)
    finally:
        vector.close()


def _rate(step: Callable[[], object], worlds: int, steps: int) -> float:
    step()
    started = time.perf_counter()
    for _ in range(steps):
        step()
    return worlds * steps / (time.perf_counter() - started)


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """One row per environment."""
    return [
        [f"{name}-v5", f"{rates['lanes']:,}", f"{theirs(rates):,}", f"{measured[name]['ratio']:g}", f"{each:.1f}"]
        for name in NAMES
        if name in measured
        for rates in (measured[name]["steps_per_second"],)
        for each in (per_core(rates, measured[name]["machine"]["cores"]),)
    ]


def measure(name: str, steps: int) -> Record:
    """Each arm in turn, several times."""
    cores = os.cpu_count() or 1
    arms = {
        "lanes": lambda: lifted(name, WORLDS, steps),
        "gymnasium, one process": lambda: vector(name, WORLDS, steps, "sync"),
        # A process for each environment: more of them than cores only wait for each other.
        "gymnasium, a process a core": lambda: vector(name, cores, steps, "async"),
    }
    rounds = [{arm: run() for arm, run in arms.items()} for _ in range(ROUNDS)]
    rates = {arm: round(statistics.median(each[arm] for each in rounds)) for arm in arms}
    ratio = round(rates["lanes"] / theirs(rates), 2)
    told = conditions("mujoco", "torch", "gymnasium")
    return {"steps_per_second": rates, "ratio": ratio, "worlds": WORLDS, **told}


def theirs(rates: Mapping[str, int]) -> int:
    """Steps a second of the faster one of Gymnasium's arms."""
    return max(rate for arm, rate in rates.items() if arm != "lanes")


def per_core(rates: Mapping[str, int], cores: int) -> float:
    """Speed of lanes on one of their cores, over that of Gymnasium's one process, which takes one."""
    return rates["lanes"] / cores / rates["gymnasium, one process"]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("names", nargs="*", default=NAMES)
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    for name in given.names:
        found = measure(name, given.steps)
        keep(given.out, name, found)
        print(f"{name}: {found['steps_per_second']}, {found['ratio']} times as fast", flush=True)


if __name__ == "__main__":
    main()
