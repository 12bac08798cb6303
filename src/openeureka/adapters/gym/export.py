"""Exports an environment as a task file to edit, and a reward as a wrapper of Gymnasium's."""

from __future__ import annotations

from collections.abc import Iterable
from pprint import pformat
from typing import TYPE_CHECKING, Any

from ...drafting.source import declared, quoted, template
from ...errors import TaskError
from ...reward.graph import spelled
from ...reward.validate import inputs
from ...types import RewardGraph, StateSpec
from .documents import WHOLE

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
            declared(variable.name, quoted(" ".join(variable.meaning.split())), variable.shape, variable.use)
            for variable in task.spec.variables
        ],
        example=next((variable for variable, _ in task.places.items()), "obs_buf"),
    )


def _written(place: slice | str) -> str:
    return f'"{place}"' if isinstance(place, str) else f"slice({place.start}, {place.stop})"


def wrapper(task: type[PaidTask], graph: RewardGraph, program: str) -> str:
    """Source of the wrapper. Raises TaskError if the reward reads a variable that a task file computes itself."""
    env, spec, places = task.survey.env, task.spec, task.places
    used = variables_read(env, graph, (*places, *WHOLE))
    return template("wrapper.py.jinja").render(
        env=env,
        make=", ".join((f'"{env}"', *(f"{key}={value!r}" for key, value in task.keywords.items()))),
        program=program,
        places=pformat({name: _place(name, places[name], spec) for name in used if name in places}, width=118),
        parts=pformat([(part.path, part.counts, part.starts) for part in task.survey.parts], width=118),
        reward=spelled(graph, spec),
    )


def variables_read(env: str, graph: RewardGraph, known: Iterable[str]) -> tuple[str, ...]:
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
