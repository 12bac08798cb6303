"""Exports an environment as a task file to edit, and a reward as a wrapper of Gymnasium's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pprint import pformat
from typing import TYPE_CHECKING, Any

from gymnasium import spaces

from ...drafting.source import declared, template
from ...errors import TaskError
from ...reward.graph import spelled
from ...reward.validate import inputs
from ...types import RewardGraph, StateSpec
from .documents import WHOLE
from .spaces import Part

if TYPE_CHECKING:
    from .task import PaidTask


def draft(task: type[PaidTask], name: str, own: str, intent: str = "") -> str:
    """Source of a task file with one class, which trains as the environment itself does.

    Args:
        task: the environment's task class.
        name: name of the class in the file.
        own: name of the task.
        intent: the sentence that a language model reads; if empty, the one from the documentation.
    """
    return template("adapter.py.jinja").render(
        env=task.env,
        fitness=task.step_fitness is not None,
        name=name,
        own=own,
        description=(intent or task.description).replace("\\", "/").replace('"', "'"),
        places=[(variable, _written(place)) for variable, place in task.places.items()],
        variables=[
            declared(variable.name, _quoted(variable.meaning), variable.shape, variable.use)
            for variable in task.spec.variables
        ],
        example=next((variable for variable, _ in task.places.items()), "obs_buf"),
    )


def _written(place: slice | str) -> str:
    return f'"{place}"' if isinstance(place, str) else f"slice({place.start}, {place.stop})"


def _quoted(text: str) -> str:
    plain = " ".join(text.split()).replace("\\", "/")
    return repr(plain) if '"' in plain else f'"{plain}"'


def wrapper(
    env: str,
    keywords: Mapping[str, Any],
    spec: StateSpec,
    places: Mapping[str, slice | str],
    parts: Iterable[Part],
    graph: RewardGraph,
    program: str,
) -> str:
    """Source of the wrapper. Raises TaskError if the reward reads a variable that a task file computes itself."""
    known = read(env, graph, (*places, *WHOLE))
    return template("wrapper.py.jinja").render(
        env=env,
        make=", ".join((f'"{env}"', *(f"{key}={value!r}" for key, value in keywords.items()))),
        program=program,
        places=pformat({name: _place(name, places[name], spec) for name in known if name in places}, width=118),
        parts=pformat([_part(part) for part in parts], width=118),
        reward=spelled(graph, spec),
    )


def read(env: str, graph: RewardGraph, known: Iterable[str]) -> tuple[str, ...]:
    """The variables that a reward reads. Raises TaskError for one that the environment does not know."""
    known = tuple(known)
    for name in inputs(graph):
        if name not in known:
            raise TaskError(
                f"The reward reads `{name}`, which `{env}` does not provide outside openeureka; train with a reward "
                "that does without it, or hide it in the task's file."
            )
    return inputs(graph)


def _place(name: str, place: slice | str, spec: StateSpec) -> Any:
    return (place, spec[name].shape) if isinstance(place, str) else (place.start, place.stop, spec[name].shape)


def _part(part: Part) -> tuple[Any, ...]:
    space = part.space
    if isinstance(space, spaces.Discrete):
        return part.path, (int(space.n),), (int(space.start),)
    if isinstance(space, spaces.MultiDiscrete):
        return part.path, tuple(space.nvec.reshape(-1).tolist()), tuple(space.start.reshape(-1).tolist())
    return part.path, (), ()
