"""Puts worlds of a two-handed task into states of a test's choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch

from openeureka.suite.shadow import FINGERS
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make
from openeureka.tasks.task import State


def fresh(env: str, worlds: int = 1) -> BatchedEnv:
    simulation = make(env, worlds=worlds, threads=1)
    simulation.reset()
    return simulation


def state_with(simulation: BatchedEnv, joints: Mapping[str, Sequence[float]]) -> State:
    """The state after joint positions (of a free joint: position, quaternion w x y z) are written into every world."""
    qpos = simulation.sim.bind("qpos")
    for name, value in joints.items():
        start = int(simulation.sim.model.joint(name).qposadr[0])
        qpos[:, start : start + len(value)] = torch.tensor(value)
    simulation.sim.forward(torch.arange(simulation.num_worlds))
    return simulation.current_state()


def scored(simulation: BatchedEnv, state: State) -> list[float]:
    """F of each world's episode if it ends in this state."""
    ended = torch.ones(simulation.num_worlds, dtype=torch.bool)
    value, weight = simulation.task.fitness(judged(simulation, state), ended)
    assert weight.tolist() == [1.0] * simulation.num_worlds
    return value.tolist()


def judged(simulation: BatchedEnv, state: State) -> State:
    """The state with `outcome`, as after a step that led to it."""
    return {**state, "outcome": simulation.task.outcome(state)}


def press(simulation: BatchedEnv, action: Mapping[int, float], steps: int) -> State:
    """The state after some steps of a constant action, 0 in all but the columns given."""
    actions = torch.zeros(simulation.num_worlds, simulation.task.num_actions)
    for column, value in action.items():
        actions[:, column] = value
    return [simulation.step(actions).state for _ in range(steps)][-1]


def let_go(simulation: BatchedEnv, steps: int) -> State:
    """The state after the physics of some control steps. Drives keep their targets, and no episode ends."""
    simulation.sim.step(steps * simulation.task.substeps)
    return simulation.current_state()


def with_fingers_at(state: State, offset: float = 0.0, **points: torch.Tensor) -> dict[str, Any]:
    """The state with all five fingers of a hand (`right=`, `left=`) at an offset [m] in x from a point (N, 3)."""
    fingers = {
        f"{side}_hand_{finger}_pos": point + torch.tensor([offset, 0.0, 0.0])
        for side, point in points.items()
        for finger in FINGERS
    }
    return {**state, **fingers}
