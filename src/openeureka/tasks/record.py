"""Real states of a task, for trying reward programs on."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import TaskError
from .faults import per_world
from .registry import make
from .task import State, Task


def try_out(env: str) -> None:
    """Take one step of one world. Raises TaskError, or whatever the task's own code raises (see `faults.fault`)."""
    simulation = make(env, worlds=1, threads=1)
    simulation.reset()
    _try_rewards(simulation.task, simulation.step(torch.zeros(1, simulation.task.num_actions)).state)


def _try_rewards(task: Task, state: State) -> None:
    """What only training calls is called here too: a fault in it must not wait until a model has been paid."""
    for method in ("human_reward", "sparse_reward"):
        per_world(task, method, getattr(task, method)(state))


STARTS = 64


def record_states(env: str, *, worlds: int = STARTS, steps: int = 40, keep: int = 4) -> dict[str, Tensor | float | int]:
    """States along random play, start states included.

    Returns:
        Every variable of the spec; world variables are (worlds * keep, *shape), taken at `keep` evenly spaced steps,
        of which the first is the start.

    Raises:
        TaskError: where F or what else the task gives cannot be used.
    """
    simulation = make(env, worlds=worlds, threads=1)
    task = simulation.task
    generator = torch.Generator().manual_seed(0)
    simulation.reset()
    taken: list[State] = [simulation.current_state()]
    for step in range(1, steps + 1):
        played = simulation.step(torch.randn(worlds, task.num_actions, generator=generator))
        state = played.state
        if not played.score.value[played.score.weight > 0].isfinite().all():
            raise TaskError(
                f"F of `{env}` is not a finite number in every state of random play; write it so that it is one: "
                "log(max(x, 0.01)) in place of log(x)."
            )
        if step % (steps // (keep - 1)) == 0 and len(taken) < keep:
            taken.append(state)
    _try_rewards(task, taken[-1])
    merged: dict[str, Tensor | float | int] = {}
    for variable in task.spec.variables:
        values = [state[variable.name] for state in taken]
        merged[variable.name] = torch.cat(values) if variable.kind == "world" else values[0]
    return merged
