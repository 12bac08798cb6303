"""What a training step costs compared with bare physics, part by part, in CPU time: a busy machine matters less.

    python benchmarks/cost.py                                   # the tasks below; some minutes
    python benchmarks/cost.py --env ant --repeats 5             # one of them; only its row is replaced

Bare physics and training take turns in one process; the ratio is that of the median costs of one environment step, all
threads together. Bare physics never resets here. In `benchmarks/throughput.py`, which counts steps a second of wall
time, raw stepping does.
"""

from __future__ import annotations

import json
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from mujoco.batch import Batch
from records import Record, command_line, conditions, keep, results

from openeureka.tasks import registry
from openeureka.training.population import Population
from openeureka.types import LaneSpec, TrainBudget

RESULTS = results("cost")
TASKS = (
    "cartpole", "ballbalance", "quadcopter", "ant", "humanoid", "anymal", "franka_cabinet",
    "allegro_hand", "shadow_hand", "shadow_hand_spin",
    "shadow_hand_over", "shadow_hand_door_open_outward", "shadow_hand_push_block", "shadow_hand_kettle",
)  # fmt: skip
TITLES = (
    "", "bare physics", "training", "of it: physics", "resets", "state, observation", "policy", "update",
    "bare / training",
)  # fmt: skip
SHOWN = ("physics", "resets", "state and observation", "policy", "update")
LANES = 2
EPOCHS = 2
RAW_STEPS = 32  # control steps of bare physics

clock = time.process_time


def bare(env: str, worlds: int) -> float:
    """CPU seconds per environment step of bare `mujoco.batch` under random controls."""
    task = registry.get(env)
    model = task.compile_model()
    batch = Batch(model, worlds, nthread=0, persistent=True)
    ctrl = batch.bind("ctrl")
    low, high = np.where(model.actuator_ctrllimited, model.actuator_ctrlrange.T, [[-1.0], [1.0]])
    random = np.random.default_rng(0)
    batch.step(nstep=task.substeps)
    started = clock()
    for _ in range(RAW_STEPS):
        ctrl[:] = random.uniform(low, high, ctrl.shape)
        batch.step(nstep=task.substeps)
    return (clock() - started) / (RAW_STEPS * worlds)


def training(env: str, worlds: int) -> tuple[float, dict[str, float]]:
    """CPU seconds per environment step of LANES lanes under the human reward, and those of its parts."""
    horizon = registry.get(env).recipe.horizon
    specs = [LaneSpec(id=str(seed), program="human", seed=seed) for seed in range(LANES)]
    population = Population(env, specs, TrainBudget(worlds=worlds, env_steps=EPOCHS * horizon * worlds))
    task, simulator, ppo = population.env.task, population.env.sim, population.ppo
    spent: defaultdict[str, float] = defaultdict(float)
    parts = {
        "physics": [(simulator, "step")],
        "resets": [(simulator, "reset"), (simulator, "forward"), (task, "reset")],
        "state and observation": [(task, "compute_state"), (task, "observe")],
        "rewards and fitness": [(task, "human_reward"), (task, "fitness"), (task, "terminated")],
        "policy": [(ppo, "act"), (ppo, "value")],
        "update": [(ppo, "update")],
    }
    for part, methods in parts.items():
        for owner, name in methods:
            setattr(owner, name, _timed(getattr(owner, name), part, spent))
    started = clock()
    list(population.train())
    total = clock() - started
    steps = LANES * EPOCHS * horizon * worlds
    return total / steps, {part: spent[part] / steps for part in parts}


def _timed(function: Callable[..., Any], part: str, spent: dict[str, float]) -> Callable[..., Any]:
    def call(*args: Any, **options: Any) -> Any:
        started = clock()
        try:
            return function(*args, **options)
        finally:
            spent[part] += clock() - started

    return call


def measure(env: str, repeats: int, worlds: int = 0) -> Record:
    """Microseconds of CPU time per environment step; 0 worlds of a lane means those of the recipe."""
    worlds = worlds or registry.get(env).recipe.worlds
    pairs = [(bare(env, LANES * worlds), training(env, worlds)) for _ in range(repeats)]
    physics, whole = [pair[0] for pair in pairs], [pair[1][0] for pair in pairs]
    parts = {part: round(1e6 * statistics.median(found[part] for _, (_, found) in pairs), 1) for part in pairs[0][1][1]}
    return {
        "worlds_per_lane": worlds,
        "lanes": LANES,
        "bare_us": [round(1e6 * seconds, 1) for seconds in physics],
        "training_us": [round(1e6 * seconds, 1) for seconds in whole],
        "training_over_bare_speed": round(statistics.median(physics) / statistics.median(whole), 3),
        "bare_physics_steps_per_cpu_second": round(registry.get(env).substeps / statistics.median(physics)),
        "parts_us": parts,
        **conditions("mujoco", "torch"),
    }


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """One row per task, in microseconds."""
    return [
        [env, *(f"{value:.0f}" for value in _microseconds(found)), f"{found['training_over_bare_speed']:.2f}"]
        for env, found in measured.items()
    ]


def _microseconds(found: Record) -> list[float]:
    whole = [statistics.median(found[name]) for name in ("bare_us", "training_us")]
    return [*whole, *(found["parts_us"][part] for part in SHOWN)]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    torch.set_num_threads(1)  # threads that wait by spinning would count as work
    for env in options.env or TASKS:
        found = measure(env, options.repeats)
        keep(options.out, env, found)
        print(env, json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
