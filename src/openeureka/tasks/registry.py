"""Finds tasks by name: the built-in ones, those of installed packages (entry point group `openeureka.tasks`), and
import strings `pkg.mod:Class`."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from importlib.metadata import entry_points

from ..errors import TaskError, nearest
from .env import BatchedEnv
from .task import Task

_BUILT_IN = {
    "cartpole": "openeureka.tasks.classic.cartpole:Cartpole",
    "ant": "openeureka.tasks.locomotion.ant:Ant",
    "humanoid": "openeureka.tasks.locomotion.humanoid:Humanoid",
    "ballbalance": "openeureka.tasks.classic.ballbalance:BallBalance",
    "quadcopter": "openeureka.tasks.classic.quadcopter:Quadcopter",
}


def names() -> list[str]:
    """Names of every task that can be trained, built-in ones first."""
    return [*_BUILT_IN, *(point.name for point in entry_points(group="openeureka.tasks"))]


def get(env: str) -> type[Task]:
    """The task's class.

    Raises:
        TaskError: when nothing of that name exists or it cannot be imported.
    """
    installed = {point.name: point.value for point in entry_points(group="openeureka.tasks")}
    target = env if ":" in env else _BUILT_IN.get(env) or installed.get(env)
    if target is None:
        raise TaskError(f"There is no environment `{env}`.{nearest(env, names())} `eureka envs` lists them all.")
    module, _, name = target.partition(":")
    try:
        task = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise TaskError(f"The environment `{env}` cannot be imported from `{target}`: {error}.") from error
    if not (isinstance(task, type) and issubclass(task, Task)):
        raise TaskError(f"`{target}` is not a subclass of openeureka.tasks.task.Task.")
    return task


def make(
    env: str, *, worlds: int, lane_seeds: Sequence[int] = (0,), device: str = "cpu", threads: int = 0
) -> BatchedEnv:
    """Build the simulation of len(lane_seeds) * worlds worlds."""
    return BatchedEnv(get(env), worlds=worlds, lane_seeds=lane_seeds, device=device, threads=threads)
