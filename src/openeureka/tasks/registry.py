"""Finds tasks by name: those of the suite, those of installed packages (entry point group `openeureka.tasks`), import
strings `pkg.mod:Class` and files `path/to/file.py`, or `path/to/file.py:Class` where a file holds several.
`PREFIX:NAME` asks the adapter of a foreign environment: `gym:Hopper-v5`.
`NAME+attribute=value` is a task with another value of a class attribute."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import TaskError, nearest
from ..parsing import literal
from ..plugins import import_file
from ..types import Ranges
from . import faults
from .env import BatchedEnv
from .randomise import RandomisedEnv
from .task import Task

_SUITE = "openeureka.suite"
"""Imported by this name alone, as anybody's package is: the tasks of the suite have no privileges."""
_FOREIGN = "openeureka.adapters.foreign"
ADAPTERS: dict[str, str] = {
    **dict.fromkeys(("gym", "gym-asis"), "openeureka.adapters.gym"),
    **dict.fromkeys(("python", "mjlab", "isaaclab", "dmc", "maniskill"), _FOREIGN),
}
"""Prefix -> module with two functions. `task(env, name, settings)` gives the class, and the settings that are left to
apply to it; `imports(name, settings)` tells whether that imports or reads a file or module which the name chooses."""


def names() -> list[str]:
    """Names of every task that can be trained, those of the suite first."""
    return [*_suite().TASKS, *_installed()]


def _suite() -> Any:
    return importlib.import_module(_SUITE)


def installed(env: str) -> bool:
    """Whether `get` finds the task without importing a file or module that `env` itself chooses."""
    name, settings = _parts(env)
    prefix, _, rest = name.partition(":")
    return not _adapter(prefix).imports(rest, settings) if prefix in ADAPTERS else name in names()


def _adapter(prefix: str) -> Any:
    return importlib.import_module(ADAPTERS[prefix])


def _parts(env: str) -> tuple[str, dict[str, str]]:
    """The name of a task, and its settings."""
    name, *settings = re.split(r"\+(?=\w+=)", env)
    return name, dict(setting.split("=", 1) for setting in settings)


def get(env: str) -> type[Task]:
    """The task's class.

    Raises:
        TaskError: when nothing of that name exists, it cannot be imported, is not a whole task or lacks an attribute.
    """
    name, settings = _parts(env)
    prefix, _, rest = name.partition(":")
    if "python" in settings and ADAPTERS.get(prefix) != _FOREIGN:
        raise TaskError(
            f"`python=` has no effect on `{name}`; it is for environments in another Python, such as "
            "python:FILE.py:NAME or dmc:DOMAIN-TASK."
        )
    if prefix in ADAPTERS:
        task, settings = _adapter(prefix).task(env, rest, settings)
    else:
        task = _named(name)
    return _changed(task, settings) if settings else task


def offered(env: str) -> type[Task] | None:
    """The class of a task that is `installed` and available here, else None. No file that `env` chooses is imported."""
    try:
        return get(env) if installed(env) else None
    except TaskError:
        return None


def variant(env: str, values: Mapping[str, object]) -> str:
    """The name of a task with other class attributes, for `get`."""
    return "+".join([env, *(f"{name}={json.dumps(value)}" for name, value in values.items())])


FIXED = ("env", "suite", "source", "steps_itself", "human", "timed")
"""Attributes that a setting cannot change: they say what a task is, or hold a program, and a name may come from a
store."""
POSITIVE = ("episode_length", "control_dt", "substeps")
"""Attributes without which nothing moves: a setting of them must be above zero."""


def _changed(task: type[Task], settings: Mapping[str, str]) -> type[Task]:
    """A subclass whose attributes are replaced by values in JSON of the same type."""
    known = {name: getattr(task, name) for name in dir(task) if not name.startswith("_") and name not in FIXED}
    known = {name: value for name, value in known.items() if isinstance(value, bool | int | float | str)}
    values: dict[str, object] = {}
    for name, text in settings.items():
        if name in getattr(task, "decided", ()):
            raise TaskError(
                f"`{name}` of `{task.env}` follows from the environment; set an argument of its constructor instead, "
                "such as frame_skip=2."
            )
        if name not in known:
            raise TaskError(f"`{task.env}` has no `{name}` to set.{nearest(name, known)} It has {', '.join(known)}.")
        value = literal(text)
        kind = type(known[name])
        values[name] = float(text) if kind is float and type(value) is int else value
        if type(values[name]) is not kind:
            raise TaskError(
                f"`{name}` of `{task.env}` is {known[name]!r}; set it to another {kind.__name__}, not to `{text}`."
            )
        if name in POSITIVE and not values[name] > 0:  # type: ignore[operator]
            raise TaskError(f"`{name}` of `{task.env}` must be more than zero, not `{text}`.")
    # A changed attribute may bound F, such as the length of an episode, or decide when one ends.
    said: dict[str, object] = {"timed": True} if "control_dt" in values else {}
    said |= {"score_range": (None, None), "ends": task.ends if set(values) <= {"episode_length"} else ""}
    return type(task.__name__, (task,), {"__module__": task.__module__, **said, **values})


def _installed() -> dict[str, str]:
    """`pkg.mod:Class` by name, from installed packages; the lookup is slow."""
    return {point.name: point.value for point in entry_points(group="openeureka.tasks")}


def _named(env: str) -> type[Task]:
    target = env if ":" in env else _suite().TASKS.get(env) or _installed().get(env)
    if env.endswith(".py"):
        target = f"{env}:{_only_task(env)}"
    if target is None and env.lower().endswith((".xml", ".mjcf", ".urdf")):
        file = f"{Path(env).stem}.py"
        raise TaskError(
            f"{env} is a robot, not a task: draft a task with `eureka new {file} model={env}`, then use env={file}."
        )
    if target is None:
        raise TaskError(f"There is no environment `{env}`.{nearest(env, names())} `eureka envs` lists them all.")
    place, _, name = target.rpartition(":")
    module = _import(place)
    task = getattr(module, name, None)
    if task is None:
        raise TaskError(f"There is no class `{name}` in {place}.{nearest(name, vars(module))}")
    if not (isinstance(task, type) and issubclass(task, Task)):
        raise TaskError(f"`{target}` is not a subclass of openeureka.tasks.task.Task.")
    values = [name for name in Task.__annotations__ if not hasattr(task, name)]
    reward = [] if task.human or task.human_reward is not Task.human_reward else ["human"]
    if missing := [*sorted(task.__abstractmethods__), *reward, *values]:
        raise TaskError(f"The task `{target}` is not complete: define {', '.join(missing)}.")
    faults.check_class(task)
    return task


def _only_task(file: str) -> str:
    """The name of the task that a file defines."""
    module = _import(file)
    own = [value for value in vars(module).values() if isinstance(value, type) and value.__module__ == module.__name__]
    tasks = [value.__name__ for value in own if issubclass(value, Task)]
    if not tasks:
        raise TaskError(f"There is no task in {file}: no class of it is a subclass of openeureka.tasks.task.Task.")
    if len(tasks) > 1:
        raise TaskError(f"{file} holds several tasks, {', '.join(tasks)}: name one, such as env={file}:{tasks[0]}.")
    return tasks[0]


def _import(place: str) -> ModuleType:
    """The module of a dotted name or of a file. Raises TaskError whatever a person's code raises on import."""
    file = Path(place).resolve() if place.endswith(".py") else None
    if file and not file.is_file():
        raise TaskError(f"There is no file {file}; env=FILE.py names a task in a file.")
    try:
        return import_file(file) if file else importlib.import_module(place)
    except (Exception, SystemExit) as error:
        raise faults.import_fault(place, error) from error


def make(
    env: str,
    *,
    worlds: int,
    lane_seeds: Sequence[int] = (0,),
    device: str = "cpu",
    threads: int = 0,
    ranges: Sequence[Ranges] = (),
) -> BatchedEnv:
    """Build the simulation of len(lane_seeds) * worlds worlds; with ranges, one per lane, they differ."""
    build = partial(RandomisedEnv, ranges=ranges) if ranges else BatchedEnv
    return build(get(env), worlds=worlds, lane_seeds=lane_seeds, device=device, threads=threads)
