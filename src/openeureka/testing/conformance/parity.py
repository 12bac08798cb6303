"""Whether two simulators agree: one control step at a time, from equal states and by equal actions."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import torch
from torch import Tensor

from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import get
from openeureka.tasks.task import Task


@dataclass(frozen=True, slots=True)
class Difference:
    """Difference of one state variable between two devices, as |a - b| / (1 + |a|)."""

    variable: str
    median: float
    """Median over worlds and steps of the largest difference among a world's numbers."""
    usual: float
    """99 % of worlds and steps are below."""
    worst: float
    """Unbounded where a contact begins on one device and not quite on the other."""


def compare(env: str, device: str, steps: int = 50, *, worlds: int = 8) -> list[Difference]:
    """Differences of every per-world state variable after each of `steps` control steps of random play, largest first.

    The CPU is the reference. Before each step the other simulation takes over its state, because contacts amplify
    rounding errors a thousandfold within ten steps. Friction cones are elliptic here: the pyramidal cones that tasks
    use depend on the two tangents of a contact, which are arbitrary. For a capsule that stands steeply on a plane,
    mujoco_warp 4.0 takes other tangents than MuJoCo.
    """
    task = _with_round_friction(get(env))
    first, second = (BatchedEnv(task, worlds=worlds, device=name, threads=1) for name in ("cpu", device))
    names = task.spec.per_world
    found: dict[str, list[Tensor]] = {name: [] for name in names}

    def note(a: dict[str, Tensor], b: dict[str, Tensor]) -> None:
        for name in names:
            x, y = (state[name].double().cpu().reshape(worlds, -1) for state in (a, b))
            found[name].append(((x - y).abs() / (1.0 + x.abs())).amax(dim=1))

    for simulation in (first, second):
        simulation.reset()
    note(first.current_state(), second.current_state())
    generator = torch.Generator().manual_seed(0)
    for _ in range(steps):
        _take_over(first, second)
        actions = torch.rand(worlds, task.num_actions, generator=generator) * 2.0 - 1.0
        states = [simulation.step(actions.to(simulation.sim.device)).state for simulation in (first, second)]
        note(*map(dict, states))
    quantiles = torch.tensor([0.5, 0.99, 1.0], dtype=torch.float64)
    differences = [Difference(name, *torch.cat(parts).quantile(quantiles).tolist()) for name, parts in found.items()]
    return sorted(differences, key=lambda difference: difference.usual, reverse=True)


def _take_over(source: BatchedEnv, target: BatchedEnv) -> None:
    """Continue `target` from where `source` is."""
    everywhere = torch.ones(target.num_worlds, dtype=torch.bool, device=target.sim.device)
    for field in ("qpos", "qvel", "act", "ctrl"):
        target.sim.bind(field).copy_(source.sim.bind(field))
    for value, known in zip(target.sim.writable(), source.sim.writable(), strict=True):
        value.copy_(known)
    target.sim.forward(everywhere)
    tensors = source.task.tensors()
    for name, value in target.task.tensors().items():
        value.copy_(tensors[name])
    target.task.noise.draws.copy_(source.task.noise.draws)


def _with_round_friction(task: type[Task]) -> type[Task]:
    class RoundFriction(task):
        @classmethod
        def compile_model(cls) -> mujoco.MjModel:
            model = super().compile_model()
            model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            return model

    return RoundFriction
