"""`eureka new`: drafts a task file, sees that it steps, and says what to do with it."""

from __future__ import annotations

import os
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import torch

from ..drafting.draft import Draft, class_name, draft
from ..errors import ConfigError
from ..parsing import command_line, parse
from ..store.artifacts import write
from ..tasks import registry
from ..tasks.task import Task
from .settings import NewConfig, only_path, split
from .terminal import trying_out

TRIED, STEPS = 8, 25
"""Worlds and steps of random play that a draft is tried with."""
MOST_NAMED = 4
"""Actuators without a range that are named."""
USAGE = "eureka new hopper.py model=hopper.xml"


def new(words: Sequence[str]) -> None:
    """Write a task file, see that it steps, and say what to do with it.

    Raises:
        ConfigError: where the file exists, is no Python file, or no model is named; for names that no file can hold.
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
    model = Path(os.path.expanduser(config.model))
    for name in map(str, (path, model, model.resolve()) if config.model else (path,)):
        if not name.isprintable() or set(name) & {'"', "\\"}:
            raise ConfigError(
                f"{name} has a character that is not allowed here, such as a quote or backslash; rename it."
            )
    if config.env and config.model:
        raise ConfigError("Name a robot with model=, or an environment with env=; not both.")
    if config.env and (config.object or config.goal or config.floating):
        raise ConfigError("object=, goal= and floating= work only with model=; leave them out with env=.")
    if config.env:
        _adapt(path, config.env, config.intent)
    elif config.model:
        _draft(path, model, config)
    else:
        raise ConfigError(f"Name a robot with model=FILE, or an environment with env=gym:ID; for example: {USAGE}")


def _draft(path: Path, model: Path, config: NewConfig) -> None:
    """Write a task file for a robot, try it with random actions and with none, and say what is open."""
    with trying_out(), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # MuJoCo's, on how the model's file is written
        drafted = draft(path, model, config.intent, thing=config.object, goal=config.goal, floating=config.floating)
        with _written(path, drafted.text):
            moved, rest = _try(path, 1.0), _try(path, 0.0)
    task = moved.task
    sizes = f"{task.num_observations} observations, {task.num_actions} actions"
    print(f"Wrote {path}: {', '.join(filter(None, (sizes, task.description)))}.")
    _say_what_counts(path, drafted, described=bool(task.description))
    if drafted.guessed:
        _say_what_is_guessed(path, drafted.guessed)
    if moved.bad:
        _say_what_breaks(moved.bad, drafted.excess, at_rest=rest.bad > 0)
    elif rest.ended:
        _say_what_falls(path, STEPS * task.control_dt)
    print("Read it, and write what the robot should do. Then")
    for command in ("play", "train", "run")[: 1 if drafted.aim.missing else None]:
        print(f"  {command_line(command, f'env={path}')}{' policy=random' if command == 'play' else ''}")


def _adapt(path: Path, env: str, intent: str) -> None:
    """Write a task file for an environment of another package, and see that it loads."""
    base = registry.get(env)
    with _written(path, base.drafted(class_name(path), path.stem, " ".join(intent.split()))):
        task = registry.get(str(path))
    print(f"Wrote {path}: {task.num_observations} observations, {task.num_actions} actions, {task.description}.")
    print(f"F is the {task.score_unit}; to change it, add +fitness=EXPRESSION to the name of the environment.")
    print("Rename, reword, hide or add the variables that rewards may read. Then")
    for command in ("context", "train", "run"):
        print(f"  {command_line(command, f'env={path}')}")


@contextmanager
def _written(path: Path, text: str) -> Generator[None]:
    """Write a file that is deleted if the block raises: a file that exists could not be drafted again."""
    write(path.parent, path.name, text)
    try:
        yield
    except BaseException:
        path.unlink()
        raise


class _Tried(NamedTuple):
    task: Task
    bad: int
    """How often the physics of a world broke down."""
    ended: bool
    """Whether an episode ended before its time."""


def _try(path: Path, size: float) -> _Tried:
    """Random play with actions up to this size."""
    simulation = registry.make(str(path), worlds=TRIED)
    simulation.scored = False
    simulation.reset()
    actions = [(torch.rand(TRIED, simulation.task.num_actions) * 2.0 - 1.0) * size for _ in range(STEPS)]
    steps = [simulation.step(action) for action in actions]
    return _Tried(simulation.task, simulation.bad_total, any(bool(step.terminated.any()) for step in steps))


def _say_what_is_guessed(path: Path, actuators: Sequence[str]) -> None:
    first = ", ".join(actuators[:MOST_NAMED])
    more = f" and {len(actuators) - MOST_NAMED} more" if len(actuators) > MOST_NAMED else ""
    print(f"The model gives no control range for {first}{more}: -1 to 1 is a guess, so set CONTROLS in {path}.")


def _say_what_breaks(bad: int, excess: str, *, at_rest: bool) -> None:
    print(f"But under random actions its physics broke down {bad} times in {TRIED} x {STEPS} steps.")
    if excess:
        print(f"Check the effort and velocity limits of its joints: {excess}.")
    elif at_rest:
        print("It also does so without actions: check the starting pose, and try more substeps.")
    else:
        print("Without actions it is stable: narrow CONTROLS, or give its joints damping and armature in `model()`.")


def _say_what_falls(path: Path, seconds: float) -> None:
    print(f"But without actions it falls within {seconds:.2g} s, which ends the episode.")
    print(f"Check the starting pose, or lower FALLEN in {path}.")


def _say_what_counts(path: Path, drafted: Draft, *, described: bool) -> None:
    """What F measures and where that comes from, or what is missing: the ranking follows F, not the intent."""
    aim, place = drafted.aim, f"`sparse_reward`, {path} line {drafted.line}"
    if aim.missing:
        print(f"F is not written yet. The draft does not guess it, because {aim.missing}.")
        print(f"Write F in {place}, or name what should go where with object=NAME goal=NAME.")
        if not described:
            print("A search also needs the aim in words: write it in `description`, or give intent=.")
        print("Until then `eureka play` works, but nothing can train.")
        return
    source = "what you said" if drafted.said else "the model; to say what you want, give intent="
    print(f"F is {aim.measure}: a guess from {source}.")
    if aim.doubt:
        print(aim.doubt)
    print(f"F ranks the rewards, whatever the intent says: if it is not what you want, change {place}.")
