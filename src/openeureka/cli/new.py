"""`eureka new`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch

from ..config import parse
from ..errors import ConfigError
from ..store.artifacts import write
from ..tasks import registry
from ..tasks.draft import Draft, draft
from ..tasks.task import Task
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
    drafted = draft(
        path,
        Path(config.model).expanduser(),
        config.intent,
        thing=config.object,
        goal=config.goal,
        floating=config.floating,
    )
    write(path.parent, path.name, drafted.text)
    task, bad = _try(path, 1.0)
    print(f"Wrote {path}: {task.num_observations} observations, {task.num_actions} actions, {task.description}.")
    _say_what_counts(path, drafted)
    if bad > 0:
        _say_what_breaks(bad, at_rest=_try(path, 0.0)[1] > 0)
    print("Read it, and say what you want of the robot. Then")
    for command in ("play", "train", "run"):
        print(f"  eureka {command} env={path}{' policy=random' if command == 'play' else ''}")


def _try(path: Path, size: float) -> tuple[Task, int]:
    """The task, and the worlds whose physics broke down in random play with actions up to this size."""
    simulation = registry.make(str(path), worlds=TRIED)
    simulation.scored = False
    simulation.reset()
    for _ in range(STEPS):
        simulation.step((torch.rand(TRIED, simulation.task.num_actions) * 2.0 - 1.0) * size)
    return simulation.task, simulation.bad_total


def _say_what_breaks(bad: int, *, at_rest: bool) -> None:
    print(f"But under random actions its physics broke down {bad} times in {TRIED} x {STEPS} steps.")
    if at_rest:
        print("It does so without actions too: look at the pose that it starts in, and try more substeps.")
    else:
        print("Without actions it holds: narrow CONTROLS, or give its joints damping and armature in `model()`.")


def _say_what_counts(path: Path, drafted: Draft) -> None:
    """What F measures and where that comes from, or what is missing: the ranking follows F, not the intent."""
    aim, place = drafted.aim, f"`sparse_reward`, {path} line {drafted.line}"
    if aim.missing:
        print(f"F is not written: the draft does not guess, as {aim.missing}.")
        print(f"Write what counts in {place}, or name it with object=NAME goal=NAME.")
        print("Until then `eureka play` works, and nothing trains.")
        return
    source = "what you said" if drafted.said else "the model; intent= says what you want"
    print(f"F is {aim.measure}: a guess from {source}.")
    if aim.doubt:
        print(aim.doubt)
    print(f"F ranks the rewards, whatever the intent says: if it is not what you want, change {place}.")
