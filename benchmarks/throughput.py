"""How fast a population trains, as ratios measured in one run.

    python benchmarks/throughput.py                # needs the extra `bench`; about 15 minutes on 2 cores
    python benchmarks/throughput.py --tiny         # seconds, to see that it works; kept nowhere
    python benchmarks/throughput.py --only start --out benchmarks/results/processes.json    # lanes over processes

Arms take turns, `--repeats` times over, so that a busy machine slows all of them alike; ratios are of medians. Every
arm reports environment steps a second over its whole training, network updates included; building models and starting
processes is left out except where a line says otherwise.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from mujoco.batch import Batch
from records import Record, command_line, conditions, results, write

from openeureka.executors import local
from openeureka.executors.local import LocalExecutor
from openeureka.numbers import number
from openeureka.tasks import registry
from openeureka.training.population import Population
from openeureka.types import LaneSpec, TrainBudget, TrainingResult

GYM_ANT = "gym:Ant-v5"
LANES = 8
RAW_EPISODE = 100  # control steps between resets of raw stepping: roughly the episodes of a policy that learns

Arm = Callable[[], float]
RESULTS = results("throughput")
PROCESSES_RESULTS = results("processes")
"""Results of the arms that `--only start` measures."""

PROCESSES = {
    "1 process, with its start": 1,
    "a process a core, with their start": os.cpu_count() or 1,
    "8 processes, with their start": LANES,
}


def raw(env: str, worlds: int, steps: int) -> float:
    """Env steps a second of `mujoco.batch` with random controls and resets: no observation, reward or policy."""
    task = registry.get(env)
    batch = Batch(task.compile_model(), worlds, nthread=0, persistent=True)
    ctrl = batch.bind("ctrl")
    random = np.random.default_rng(0)
    batch.step(nstep=task.substeps)
    started = time.perf_counter()
    for step in range(steps):
        if step % RAW_EPISODE == 0:
            batch.reset()
        ctrl[:] = random.uniform(-1.0, 1.0, ctrl.shape)
        batch.step(nstep=task.substeps)
    return steps * worlds / (time.perf_counter() - started)


def lanes(env: str, count: int, worlds: int, epochs: int) -> float:
    """`count` lanes in this process."""
    budget = TrainBudget(worlds=worlds, env_steps=epochs * registry.get(env).recipe.horizon * worlds)
    population = Population(env, [LaneSpec(id=str(i), program="human", seed=i) for i in range(count)], budget)
    results = [message for message in population.train() if isinstance(message, TrainingResult)]
    return sum(result.env_steps for result in results) / results[0].seconds


def waited(env: str, processes: int, worlds: int, epochs: int) -> float:
    """8 lanes in worker processes that share all cores, with their start: what a person waits for."""
    budget = TrainBudget(worlds=worlds, env_steps=epochs * registry.get(env).recipe.horizon * worlds)
    specs = [LaneSpec(id=str(i), program="human", seed=i) for i in range(LANES)]
    started = time.perf_counter()
    cores = max(os.cpu_count() or 1, processes)
    with patch.multiple(local, usable_cores=lambda: cores, CPU_WORKERS=processes):
        messages = list(LocalExecutor().train(env, specs, budget))
    results = [message for message in messages if isinstance(message, TrainingResult)]
    failed = [result.message for result in results if not result.env_steps]
    if failed:
        raise SystemExit(failed[0])
    return sum(result.env_steps for result in results) / (time.perf_counter() - started)


def stable_baselines(envs: int, steps: int, **options: object) -> float:
    """Stable-baselines3's PPO on Ant-v5; more than one environment runs in a process per core."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    kind = DummyVecEnv if envs == 1 else SubprocVecEnv
    vector = make_vec_env("Ant-v5", n_envs=envs, seed=0, vec_env_cls=kind)
    try:
        learner = PPO("MlpPolicy", vector, device="cpu", seed=0, **options)  # pyright: ignore[reportArgumentType]
        started = time.perf_counter()
        learner.learn(total_timesteps=steps)
        return learner.num_timesteps / (time.perf_counter() - started)
    finally:
        vector.close()


def arms(tiny: bool) -> dict[str, Arm]:
    """Every measurement by name; sizes give each a quarter of a minute or so on two cores."""
    scale = 20 if tiny else 1
    cores = os.cpu_count() or 1
    # Its fastest honest setting: one environment a core, and the batch, passes and network of our recipe.
    ours = registry.get(GYM_ANT).recipe
    batch = ours.worlds * ours.horizon
    matched = {
        "n_steps": batch // cores,
        "batch_size": batch // ours.minibatches,
        "n_epochs": ours.epochs,
        "policy_kwargs": {"net_arch": list(ours.hidden)},
    }
    found: dict[str, Arm] = {
        "gym_ant/raw": lambda: raw(GYM_ANT, 512, 160 // scale),
        "gym_ant/8 lanes": lambda: lanes(GYM_ANT, LANES, 64, max(1, 10 // scale)),
        "gym_ant/stable-baselines3, defaults": lambda: stable_baselines(
            1, 10_240 // scale, **({"n_steps": 256} if tiny else {})
        ),
        "gym_ant/stable-baselines3, an environment a core": lambda: stable_baselines(
            cores, 10_240 // scale, n_steps=(256 if tiny else 2048) // cores
        ),
        "gym_ant/stable-baselines3, our batch, an environment a core": lambda: stable_baselines(
            cores, 10_240 // scale, **matched
        ),
    }
    for env in ("ant", "humanoid"):
        found |= {
            f"{env}/raw": lambda env=env: raw(env, 512, 400 // scale),
            f"{env}/1 lane": lambda env=env: lanes(env, 1, 512, max(1, 10 // scale)),
            f"{env}/8 lanes": lambda env=env: lanes(env, LANES, 64, max(1, 10 // scale)),
        }
    return found | {
        f"ant/8 lanes, {name}": lambda processes=processes: waited("ant", processes, 128, max(1, 40 // scale))
        for name, processes in PROCESSES.items()
    }


RATIOS = {
    "training over stable-baselines3 defaults": ("gym_ant/8 lanes", "gym_ant/stable-baselines3, defaults"),
    "training over stable-baselines3, an environment a core": (
        "gym_ant/8 lanes",
        "gym_ant/stable-baselines3, an environment a core",
    ),
    "training over stable-baselines3 with our batch": (
        "gym_ant/8 lanes",
        "gym_ant/stable-baselines3, our batch, an environment a core",
    ),
    "training over raw stepping, Gymnasium's ant": ("gym_ant/8 lanes", "gym_ant/raw"),
    "training over raw stepping, ant": ("ant/8 lanes", "ant/raw"),
    "training over raw stepping, ant, 1 lane": ("ant/1 lane", "ant/raw"),
    "training over raw stepping, humanoid": ("humanoid/8 lanes", "humanoid/raw"),
    "one process over eight": ("ant/8 lanes, 1 process, with its start", "ant/8 lanes, 8 processes, with their start"),
    "a process a core over one process": (
        "ant/8 lanes, a process a core, with their start",
        "ant/8 lanes, 1 process, with its start",
    ),
}

BASELINES = (" defaults", ", an environment a core", " with our batch")
RAW = ("Gymnasium's ant", "ant", "humanoid")


def measure(repeats: int, tiny: bool, only: str) -> dict[str, list[float]]:
    """Env steps a second, one number per repeat, of the arms whose name contains `only`."""
    chosen = {name: arm for name, arm in arms(tiny).items() if only in name}
    found: dict[str, list[float]] = {name: [] for name in chosen}
    for repeat in range(repeats):
        for name, arm in chosen.items():
            found[name].append(round(arm(), 1))
            print(f"{repeat + 1}/{repeats} {name:62s} {found[name][-1]:>10.0f} steps/s", flush=True)
    return found


def report(measured: dict[str, list[float]]) -> dict[str, object]:
    median = {name: statistics.median(values) for name, values in measured.items()}
    return {
        "steps_per_second": measured,
        "ratio_of_medians": {
            name: round(median[ours] / median[theirs], 3)
            for name, (ours, theirs) in RATIOS.items()
            if ours in median and theirs in median
        },
        **conditions("mujoco", "torch", "gymnasium", "stable-baselines3"),
        "torch_threads": torch.get_num_threads(),
    }


def sentence(measured: Record) -> str:
    """How eight lanes compare with stable-baselines3, and with physics without a learner."""
    ratio: Mapping[str, float] = measured["ratio_of_medians"]
    theirs = [number(ratio[f"training over stable-baselines3{arm}"], 2) for arm in BASELINES]
    ours, ant, humanoid = (number(ratio[f"training over raw stepping, {env}"], 2) for env in RAW)
    return (
        f"Eight lanes of Gymnasium's Ant train {theirs[0]} times as fast as stable-baselines3's PPO with its defaults. "
        f"With one environment per core there, it is {theirs[1]} times; with our batch, passes and network as well, "
        f"{theirs[2]} times. Training runs at {ours} of the speed of the simulator alone, "
        f"resets included. For our Ant this share is {ant}, for Humanoid {humanoid}.\n"
    )


def waiting(measured: Record) -> str:
    """How several workers compare with one."""
    ratio: Mapping[str, float] = measured["ratio_of_medians"]
    more, fewer = ratio["a process a core over one process"], 1 / ratio["one process over eight"]
    return (
        f"With eight lanes of Ant on {measured['machine']['cores']} cores, one worker per core is {number(more, 3)} "
        f"times as fast as a single worker, and eight workers are {number(fewer, 2)} times as fast, start included.\n"
    )


def sleep_when_idle() -> None:
    """Start again with OpenMP threads that sleep instead of spinning, which would starve the simulator's threads; the
    setting is only read when torch is loaded."""
    if "GOMP_SPINCOUNT" not in os.environ:
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "GOMP_SPINCOUNT": "0"})


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--tiny", action="store_true", help="a twentieth of the work, kept nowhere")
    parser.add_argument("--only", default="", help="measure the arms whose name contains this; takes an --out")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    if options.only and not (options.out or options.tiny):
        parser.error("--only measures some of the arms: name a file of theirs with --out.")
    sleep_when_idle()
    found = report(measure(options.repeats, options.tiny, options.only))
    for name, ratio in found["ratio_of_medians"].items():  # pyright: ignore[reportAttributeAccessIssue]
        print(f"{name:62s} {ratio:>8.2f}")
    if not options.tiny:
        write(options.out or RESULTS, found)


if __name__ == "__main__":
    main()
