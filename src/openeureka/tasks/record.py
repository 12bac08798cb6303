"""Real states of a task, for trying reward programs on."""

from __future__ import annotations

import torch
from torch import Tensor

from .registry import make
from .task import State

STARTS = 64


def record_states(env: str, *, worlds: int = STARTS, steps: int = 40, keep: int = 4) -> dict[str, Tensor | float | int]:
    """States along random play, start states included.

    Returns:
        Every variable of the spec; world variables are (worlds * keep, *shape), taken at `keep` evenly spaced steps,
        of which the first is the start.
    """
    simulation = make(env, worlds=worlds, threads=1)
    task = simulation.task
    generator = torch.Generator().manual_seed(0)
    simulation.reset()
    taken: list[State] = [simulation.current_state()]
    for step in range(1, steps + 1):
        state = simulation.step(torch.randn(worlds, task.num_actions, generator=generator)).state
        if step % (steps // (keep - 1)) == 0 and len(taken) < keep:
            taken.append(state)
    merged: dict[str, Tensor | float | int] = {}
    for variable in task.spec.variables:
        values = [state[variable.name] for state in taken]
        merged[variable.name] = torch.cat(values) if variable.kind == "world" else values[0]
    return merged
