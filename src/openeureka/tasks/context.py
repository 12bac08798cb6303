"""Environment as context: what a language model reads of a task."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

from torch import Tensor

from ..config import RunConfig
from ..errors import TaskError
from ..reward.states import Recorded
from ..text import plain
from ..types import COSTS, StateSpec, TaskContext
from . import curriculum, ranges
from .record import STARTS
from .registry import get
from .source import prune
from .task import Task

AIMLESS = "what it is made for"
"""What a description ends with where nothing says what the task is for."""
_NEAREST = 2
"""Nearest points whose distance is told, for each point."""
_MAX_POINTS = 10
_MAX_COLUMNS = 3
"""Most columns of vectors whose ranges are told column by column."""
_SAME, _PART = 1e-4, 0.2
"""[m] Points that stay closer than the first are one; those of a hand, within the second, are told as its palm."""
_log = logging.getLogger(__name__)


def context(env: str) -> TaskContext:
    """Description, score, state table and pruned source or documentation of a task.

    Raises TaskError when the description is empty.
    """
    task = get(env)
    if not task.description.strip():
        raise TaskError(
            f"`description` of the task `{task.env}` is empty: write there what is wanted, for the language model."
        )
    if task.description.endswith(AIMLESS):
        _log.warning("The documentation of %s states no goal: add +description='to ...' to env=%s", task.env, task.env)
    return TaskContext(
        env=env,
        description=task.description,
        state=task.spec,
        source=task.source or prune(task),
        documented=bool(task.source),
        score_unit=task.score_unit,
        score_range=task.score_range,
        window=task.window(),
    )


def informed(known: TaskContext, recorded: Recorded, config: RunConfig) -> TaskContext:
    """The context with the facts of a search: how long episodes and trainings are, what ends them and where they start,
    and what is drawn. What safety asks for becomes part of the description, which every prompt has.

    Args:
        recorded: as `record.record_states` gives them, start states first; nothing is told of missing variables.
    """
    task = get(config.env)
    states = {name: value for name, value in recorded.items() if isinstance(value, Tensor)}
    starts = [*_scalars(task.spec, states), *_points(task.spec, states)]
    heading = [f"At the start of an episode, in {STARTS} of them:"] if starts else []
    said = (
        _episode(task),
        _training(task, config),
        _discount(task),
        *_worlds(config),
        *_unseen(task, config),
    )
    safety = f", and to do so safely: {plain(config.safety)}" if config.safety else ""
    asked = ". ".join([f"{known.description}{safety}", *_limits(config)])
    return replace(known, description=asked, facts=(*said, *heading, *starts))


def _episode(task: type[Task]) -> str:
    steps = task.time_limit()
    seconds = f" of {task.control_dt:.3g} s, {steps * task.control_dt:.3g} s in all" if task.timed else ""
    return f"An episode has at most {steps} steps{seconds}. {task.ends}".rstrip()


def _training(task: type[Task], config: RunConfig) -> str:
    if config.curriculum:
        steps = config.steps or sum(stage.steps for stage in curriculum.find(config.env, config.curriculum))
        return f"A policy trains for {steps:,} steps in all, over the stages of a curriculum."
    recipe = task.recipe
    steps, worlds = config.steps or recipe.env_steps, config.worlds or recipe.worlds
    epochs = max(1, steps // (worlds * recipe.horizon))
    return (
        f"A policy trains for {steps:,} steps in all: {epochs} epochs of {recipe.horizon} steps in each of {worlds} "
        "environments."
    )


def _worlds(config: RunConfig) -> list[str]:
    drawn = ranges.find(config.env, config.randomise)
    return [f"Worlds of training differ, a factor being one on the model's own value: {drawn}."] if drawn else []


def _unseen(task: type[Task], config: RunConfig) -> list[str]:
    names = ", ".join(f"`{name}`" for name, _ in task.unmeasured) if config.observe != "all" else ""
    return [f"The policy does not observe {names}, which no sensor tells; a reward may use it."] if names else []


def _limits(config: RunConfig) -> list[str]:
    most = [f"{name} {most:g} {COSTS[name].unit} ({COSTS[name].meaning})" for name, most in config.cost_limits.items()]
    return [f"A policy may cost at most, or its reward cannot win: {'; '.join(most)}"] if most else []


def _discount(task: type[Task]) -> str:
    if task.recipe.gamma == 1.0:
        return "Nothing is discounted: what comes later in an episode counts in full."
    steps = round(1 / (1 - task.recipe.gamma))
    seconds = steps * task.control_dt
    told = f"{seconds:.0f}" if seconds >= 99.5 else f"{seconds:.2g}"  # two digits, and no exponent
    later = f"{steps} steps ({told} s)" if task.timed else f"{steps} steps"
    return f"The discount is {task.recipe.gamma:g} a step: what comes {later} later counts about a third."


def _scalars(spec: StateSpec, states: Mapping[str, Tensor]) -> list[str]:
    """A line with the ranges of the numbers whose use is known, and of short vectors that are not zero at the start."""
    ranges: list[str] = []
    for variable in spec.variables:
        if variable.kind != "world" or variable.name not in states:
            continue
        value = states[variable.name][:STARTS]
        if not variable.shape and variable.use != "raw":
            ranges.append(f"`{variable.name}` {_range(value)}")
        elif variable.use == "zero_centred" and len(variable.shape) == 1 and variable.shape[0] <= _MAX_COLUMNS:
            columns = [_range(column) for column in value.unbind(dim=-1)]
            if set(columns) != {"0"}:
                ranges.append(f"`{variable.name}` ({', '.join(columns)})")
    return [f"  {', '.join(ranges)}"] if ranges else []


def _points(spec: StateSpec, states: Mapping[str, Tensor]) -> list[str]:
    """A line for each point: where it is, and how far the nearest others are, unless an earlier line has told that."""
    told = [v.name for v in spec.variables if v.kind == "world" and v.use == "point"]
    names = _distinct({name: states[name] for name in told if name in states})
    points = {name: states[name][:STARTS] for name in names}
    gaps = {frozenset(pair): (points[pair[0]] - points[pair[1]]).norm(dim=-1) for pair in combinations(names, 2)}
    said: set[frozenset[str]] = set()
    lines = []
    for name, place in points.items():
        own = sorted((pair for pair in gaps if name in pair), key=lambda pair: float(gaps[pair].mean()))
        near = [pair for pair in own[:_NEAREST] if pair not in said]
        said.update(near)
        others = [f", {_range(gaps[pair])} m from `{next(iter(pair - {name}))}`" for pair in near]
        where = ", ".join(_range(column, decimals=3) for column in place.unbind(dim=-1))
        lines.append(f"  `{name}` ({where}) m{''.join(others)}")
    return lines


def _distinct(points: Mapping[str, Tensor]) -> list[str]:
    """Names of points: the first of those that always coincide, and the hand alone in place of its many parts."""

    def apart(one: str, other: str) -> float:
        return float((points[one] - points[other]).norm(dim=-1).max())

    kept: list[str] = []
    for name in points:
        if all(apart(name, other) > _SAME for other in kept):
            kept.append(name)
    stems = {name: name.removesuffix("_pos").removesuffix("_position") for name in kept}
    parts = {
        name: [part for part in kept if stems[part].startswith(f"{stems[name]}_") and apart(name, part) < _PART]
        for name in kept
    }
    hidden = {part for family in parts.values() if len(family) > 2 for part in family}
    return [name for name in kept if name not in hidden][:_MAX_POINTS]


def _range(values: Tensor, decimals: int = 2) -> str:
    low, high = _number(float(values.min()), decimals), _number(float(values.max()), decimals)
    return low if low == high else f"{low} to {high}"


def _number(value: float, decimals: int) -> str:
    """With these decimals; below 0.1 with two significant digits, and below 0.001 as 0."""
    if abs(value) < 1e-3:
        return "0"
    return f"{value:.2g}" if abs(value) < 0.1 else f"{value:.{decimals}f}".rstrip("0").rstrip(".")
