"""Whether two simulators agree: the same actions from the same starts, compared step by step."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from openeureka.tasks.registry import get, make


@dataclass(frozen=True, slots=True)
class Difference:
    """Of one state variable between two devices."""

    variable: str
    median: float
    """Over worlds and components, of |a - b| / (1 + |a|), at the step where it is largest."""
    worst: float
    """The largest one of all."""


def compare(env: str, device: str, steps: int = 50, *, worlds: int = 8, reference: str = "cpu") -> list[Difference]:
    """Differences of every per-world state variable over `steps` control steps of random play, the largest first.

    Worlds are not compared beyond the first step on which either device ended their episode.
    """
    first, second = (make(env, worlds=worlds, device=name) for name in (reference, device))
    task = get(env)
    names = [variable.name for variable in task.spec.variables if variable.kind == "world"]
    generator = torch.Generator().manual_seed(0)
    same = torch.ones(worlds, dtype=torch.bool)
    found: dict[str, list[Tensor]] = {name: [] for name in names}
    for simulation in (first, second):
        simulation.reset()
    states = first.current_state(), second.current_state()
    for _ in range(steps):
        for name in names:
            a, b = (state[name].cpu().double().reshape(worlds, -1)[same] for state in states)
            found[name].append((a - b).abs() / (1.0 + a.abs()))
        actions = torch.rand(worlds, task.num_actions, generator=generator) * 2.0 - 1.0
        taken = [simulation.step(actions.to(simulation.sim.device)) for simulation in (first, second)]
        states = taken[0].state, taken[1].state
        same &= ~(taken[0].done.cpu() | taken[1].done.cpu())
    summaries = [
        Difference(
            variable=name,
            median=max(float(part.median()) for part in parts if part.numel()),
            worst=max(float(part.max()) for part in parts if part.numel()),
        )
        for name, parts in found.items()
    ]
    return sorted(summaries, key=lambda difference: difference.worst, reverse=True)
