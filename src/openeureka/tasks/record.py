"""Real states of a task, for trying reward programs on."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import TaskError
from . import faults
from .env import BatchedEnv, Step
from .registry import make
from .task import State, Task


def try_out(env: str) -> None:
    """Take one step of one world. Raises TaskError, or whatever the task's own code raises (see `faults.fault`)."""
    simulation = make(env, worlds=1, threads=1)
    simulation.reset()
    _try_rewards(simulation.task, _step(simulation, torch.zeros(1, simulation.task.num_actions)).state)


def _step(simulation: BatchedEnv, actions: Tensor) -> Step:
    """One step. Raises TaskError where the task replaced what the simulator reads, or what it gives is not finite."""
    inputs = faults.inputs(simulation.task)
    played = simulation.step(actions)
    faults.check_inputs(simulation.task, inputs)
    faults.check_finite(simulation.task, played.state, ~played.bad)
    return played


def _try_rewards(task: Task, state: State) -> None:
    """Call what otherwise only training calls: a fault in it must show before a language model has been paid."""
    for method in ("human_reward", "sparse_reward"):
        faults.per_world(task, method, getattr(task, method)(state))


STARTS = 64


def record_states(
    env: str, *, worlds: int = STARTS, steps: int = 40, keep: int = 4, scored: bool = True
) -> dict[str, Tensor | float | int]:
    """States along random play, start states included.

    Args:
        scored: whether F and the rewards of the task are tried too.

    Returns:
        Every variable of the spec; world variables are (worlds * keep, *shape), taken at `keep` evenly spaced steps,
        of which the first is the start.

    Raises:
        TaskError: where F or another value of the task cannot be used, or its physics breaks down in most steps.
    """
    simulation = make(env, worlds=worlds, threads=1)
    simulation.scored, task = scored, simulation.task
    generator = torch.Generator().manual_seed(0)
    simulation.reset()
    taken: list[State] = [simulation.current_state()]
    faults.check_finite(task, taken[0], torch.ones(worlds, dtype=torch.bool))
    for step in range(1, steps + 1):
        played = _step(simulation, torch.randn(worlds, task.num_actions, generator=generator))
        state = played.state
        if not played.score.value[played.score.weight > 0].isfinite().all():
            raise TaskError(
                f"F of `{env}` is not finite in some states of random play; keep it finite, for example with "
                "log(max(x, 0.01)) in place of log(x)."
            )
        if step % (steps // (keep - 1)) == 0 and len(taken) < keep:
            taken.append(state)
    if simulation.bad_total > worlds * steps / 2:
        physics = "make its actions weaker, give its joints damping and armature, or raise `substeps`."
        numbers = "its observations and rewards must be finite."
        raise TaskError(
            f"`{env}` breaks down in {simulation.bad_total} of {worlds * steps} steps of random play, and such steps do"
            f" not count: {numbers if task.steps_itself else physics}"
        )
    if scored:
        _try_rewards(task, taken[-1])
    merged: dict[str, Tensor | float | int] = {}
    for variable in task.spec.variables:
        values = [state[variable.name] for state in taken]
        merged[variable.name] = torch.cat(values) if variable.kind == "world" else values[0]
    return merged
