"""Curricula: what `curriculum=` names, checked before anything is trained."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import ConfigError, TaskError, nearest
from ..parsing import absolute, read_yaml, whole_number
from .registry import get, variant
from .task import Stage, Task

_FIELDS = {"env": (str, "a name"), "set": (dict, "a mapping"), "steps": (int, "a whole number, zero or more")}
"""Of a `Stage`: the type that YAML gives, and what is wanted, in words."""


def find(env: str, curriculum: str) -> tuple[Stage, ...]:
    """The stages of one of the task's own curricula or of a YAML file, with their tasks' names and steps filled in.

    Raises:
        ConfigError: when there is no such curriculum, or a policy and a reward could not go through all of its stages.
    """
    task = get(env)
    if curriculum.endswith((".yaml", ".yml")):
        stages = _read(Path(curriculum))
    elif curriculum in task.curricula:
        stages = task.curricula[curriculum]
    else:
        own = ", ".join(task.curricula)
        raise ConfigError(
            f"`{task.env}` has no curriculum `{curriculum}`.{nearest(curriculum, task.curricula)} "
            f"It has {f'{own}. Name one of these or' if own else 'none: name'} a YAML file."
        )
    if stages[-1].env or stages[-1].set:
        raise ConfigError(f"The last stage of `{curriculum}` is the task itself: leave `env` and `set` out of it.")
    return tuple(_checked(stage, env, f"stage {number} of `{curriculum}`") for number, stage in enumerate(stages, 1))


def _read(path: Path) -> tuple[Stage, ...]:
    """A list of mappings with the fields of a Stage; paths of task files are relative to the list's folder."""
    found = read_yaml(path, "curriculum")
    if not (isinstance(found, list) and found and all(isinstance(stage, dict) for stage in found)):
        raise ConfigError(f"The curriculum {path} must be a list of stages, such as `- {{steps: 100000}}`.")
    return tuple(_stage(stage, path) for stage in found)


def _steps(value: Any) -> Any:
    """As a whole number, where it is one: YAML takes `1e6` for a text, and `1.0e+6` for a float."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    with suppress(ValueError):
        return whole_number(value) if isinstance(value, str) else value
    return value


def _stage(values: dict, path: Path) -> Stage:
    values = {**values, "steps": _steps(values["steps"])} if "steps" in values else values
    for key, value in values.items():
        if key not in _FIELDS:
            raise ConfigError(f"A stage in {path} has an unknown key `{key}`; the keys are {', '.join(_FIELDS)}.")
        kind, wanted = _FIELDS[key]
        if type(value) is not kind or (key == "steps" and value < 0):
            raise ConfigError(f"`{key}: {value}` of a stage in {path} does not fit: `{key}` takes {wanted}.")
    return Stage(**{**values, "env": absolute("env", values.get("env", ""), path.parent)})


def _checked(stage: Stage, env: str, where: str) -> Stage:
    """The stage with its task's whole name in `env`, and its steps."""
    name = variant(stage.env or env, stage.set)
    try:
        task = get(name)
    except TaskError as error:
        raise ConfigError(f"In {where}: {error}") from None
    if what := _difference(task, get(env)):
        raise ConfigError(
            f"In {where}: the {what} of `{task.env}` and `{get(env).env}` differ, so one policy and reward cannot train"
            " on both."
        )
    for number in (variable.name for variable in task.spec.variables if variable.kind in ("float", "int")):
        if getattr(task, number, None) != getattr(get(env), number, None):  # a reward holds the last stage's value
            raise ConfigError(f"In {where}: rewards read `{number}`, so it must be the same in all stages.")
    return Stage(env=name, steps=stage.steps or task.recipe.env_steps)


def _difference(one: type[Task], other: type[Task]) -> str:
    """What keeps a policy and its reward from going from one task to the other; empty when nothing does."""
    if one.num_observations != other.num_observations:
        return "observations"
    if one.num_actions != other.num_actions:
        return "actions"
    if one.choices != other.choices:
        return "choices"
    if one.recipe.hidden != other.recipe.hidden:
        return "network sizes"
    shapes = {variable.name: (variable.kind, variable.shape) for variable in one.spec.variables}
    wanted = {variable.name: (variable.kind, variable.shape) for variable in other.spec.variables}
    return "" if wanted.items() <= shapes.items() else "state variables"
