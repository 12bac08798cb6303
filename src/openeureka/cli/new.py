"""`eureka new`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch

from ..config import parse
from ..errors import ConfigError
from ..store.artifacts import write
from ..tasks import registry
from ..tasks.draft import class_name, draft
from .settings import NewConfig, only_path, split

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
    write(path, draft(path, Path(config.model).expanduser(), config.intent))
    env = f"{path}:{class_name(path)}"
    simulation = registry.make(env, worlds=2)
    simulation.reset()
    simulation.step(torch.zeros(2, simulation.task.num_actions))
    task = simulation.task
    print(f"Wrote {path}: {task.num_observations} observations, {task.num_actions} actions, {task.description}.")
    print("It trains as it is; read it, and say what you want of the robot. Then")
    for command in ("play", "train", "run"):
        print(f"  eureka {command} env={env}{' policy=random' if command == 'play' else ''}")
