"""`eureka new`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch

from ..config import parse
from ..errors import ConfigError
from ..store.artifacts import write
from ..tasks import registry
from ..tasks.draft import draft
from .settings import NewConfig, only_path, split

TRIED, STEPS = 8, 25
"""Worlds and steps of random play that a draft is tried with."""
USAGE = "eureka new hopper.py model=hopper.xml"


def new(words: Sequence[str]) -> None:
    """Write a task file, see that it steps, and say what to do with it.

    Raises:
        ConfigError: where the file exists, is no Python file, or no model is named.
        TaskError: when a model cannot be read, or nothing can move it.
    """
    settings, paths = split(words)
    config, path = parse(NewConfig, settings), only_path(paths, USAGE)
    if path.suffix != ".py":
        raise ConfigError(f"A task is a Python file, not {path}; for example: {USAGE}")
    if path.exists():
        raise ConfigError(f"{path} exists already; choose another name, or delete it.")
    if not path.parent.is_dir():
        raise ConfigError(f"There is no folder {path.parent}; make it first, or choose another place.")
    if not config.model:
        raise ConfigError(f"Name the robot, a MuJoCo XML file; for example: {USAGE}")
    write(path.parent, path.name, draft(path, Path(config.model).expanduser(), config.intent))
    simulation = registry.make(str(path), worlds=TRIED)
    task = simulation.task
    simulation.reset()
    for _ in range(STEPS):
        simulation.step(torch.rand(TRIED, task.num_actions) * 2.0 - 1.0)
    print(f"Wrote {path}: {task.num_observations} observations, {task.num_actions} actions, {task.description}.")
    if (bad := simulation.bad_total) > 0:
        print(
            f"But its physics broke down {bad} times in {TRIED} x {STEPS} steps under random actions: look at the pose"
        )
        print("that it starts in and at the range of its actuators, and try more substeps.")
    print("Read it, and say what you want of the robot. Then")
    for command in ("play", "train", "run"):
        print(f"  eureka {command} env={path}{' policy=random' if command == 'play' else ''}")
