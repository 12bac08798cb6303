"""What the guards of training cost: throughput with all of them on over throughput with all of them off.

    python benchmarks/guards.py                # about 10 minutes on 2 quiet cores
    python benchmarks/guards.py --tiny         # seconds, to see that it works; kept nowhere

Guards are the watch on rewards, policies and scores of each lane, and the check of the physics. Trainings with and
without them alternate, in pairs that begin with the one or the other in turn, so that a busy machine slows both alike;
the ratio is the median over pairs. Processor time is reported besides wall-clock time: it does not count what other
processes do.
"""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import NamedTuple

import torch
from records import command_line, conditions, results, write
from torch import Tensor

from openeureka.tasks import registry
from openeureka.training.population import Population
from openeureka.types import LaneSpec, Node, RewardGraph, TrainBudget, TrainingResult

ENVS = ("cartpole", "ant")
LANES = 8
PAIRS, EPOCHS = 9, 12


class Pace(NamedTuple):
    wall: float
    """Env steps a second."""
    processor: float
    """Env steps a second of processor time, of all threads."""


class Unguarded(Population):
    """Trains without guards."""

    def __init__(self, env: str, specs: list[LaneSpec], budget: TrainBudget) -> None:
        super().__init__(env, specs, budget)
        self.env.check = lambda: None

    def _watch(self, own: Tensor) -> None: ...

    def _mask_diverged(self, epoch: int) -> None: ...


def reward() -> RewardGraph:
    """exp(-|v| / 2) - 0.1 |v| of all joint velocities, with both terms as components."""
    nodes = (
        Node("input", ("dof_vel",)),
        Node("linalg_vector_norm.default", ({"ref": 0}, 2, (1,))),
        Node("mul.Tensor", ({"ref": 1}, -0.5)),
        Node("exp.default", ({"ref": 2},)),
        Node("mul.Tensor", ({"ref": 1}, -0.1)),
        Node("add.Tensor", ({"ref": 3}, {"ref": 4})),
    )
    return RewardGraph(nodes=nodes, reward=5, components=(("calm", 3), ("speed", 4)))


def pace(kind: type[Population], env: str, epochs: int) -> Pace:
    """Speed of a whole training, without its start."""
    recipe = registry.get(env).recipe
    specs = [LaneSpec(id=str(lane), program=reward(), seed=lane) for lane in range(LANES)]
    population = kind(env, specs, TrainBudget(env_steps=epochs * recipe.horizon * recipe.worlds))
    wall, processor = time.perf_counter(), time.process_time()
    steps = sum(message.env_steps for message in population.train() if isinstance(message, TrainingResult))
    return Pace(steps / (time.perf_counter() - wall), steps / (time.process_time() - processor))


def compare(
    env: str, on: type[Population], off: type[Population], pairs: int, epochs: int
) -> dict[str, dict[str, float | list[float]]]:
    """Steps a second of one kind of training over those of another; the two alternate."""
    ratios: list[Pace] = []
    for kind in (on, off):
        pace(kind, env, 1)  # the first training of a process is slower, of either kind
    for pair in range(pairs):
        paces = {kind: pace(kind, env, epochs) for kind in ((on, off) if pair % 2 else (off, on))}
        ratios.append(Pace(*(with_it / without for with_it, without in zip(paces[on], paces[off], strict=True))))
        print(f"{env} {pair + 1}/{pairs}: wall {ratios[-1].wall:.3f}, processor {ratios[-1].processor:.3f}", flush=True)
    return {
        name: {"median": round(statistics.median(values), 4), "pairs": [round(value, 4) for value in values]}
        for name, values in zip(Pace._fields, zip(*ratios, strict=True), strict=True)
    }


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--tiny", action="store_true", help="one pair of one epoch, kept nowhere")
    parser.add_argument("--out", type=Path, default=results("guards"))
    options = parser.parse_args()
    pairs, epochs = (1, 1) if options.tiny else (PAIRS, EPOCHS)
    found = {
        "guarded_over_unguarded": {env: compare(env, Population, Unguarded, pairs, epochs) for env in ENVS},
        "lanes": LANES,
        "epochs": epochs,
        **conditions("mujoco", "torch"),
        "torch_threads": torch.get_num_threads(),
    }
    if not options.tiny:
        write(options.out, found)


if __name__ == "__main__":
    main()
