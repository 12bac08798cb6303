"""Environment as context: what a language model reads of a task."""

from __future__ import annotations

import inspect

from ..types import TaskContext
from .registry import get
from .task import Task

# An allow-list, so that nothing a task adds later (fitness, rewards, thresholds, training defaults) leaks by default.
_VISIBLE = ("apply_action", "compute_state", "observe")


def context(env: str) -> TaskContext:
    """Description, state table and pruned source of a task."""
    task = get(env)
    return TaskContext(
        env=env,
        description=task.description,
        state=task.spec,
        source=prune(task),
        score_unit=task.score_unit,
        score_range=task.score_range,
    )


def prune(task: type[Task]) -> str:
    """The task's class, and above it those it builds on, with only the methods that turn actions into motion and motion
    into state."""
    lineage = [cls for cls in reversed(task.__mro__) if issubclass(cls, Task) and cls is not Task]
    return "\n\n\n".join(_visible_part(cls) for cls in lineage)


def _visible_part(cls: type[Task]) -> str:
    bases = ", ".join(base.__name__ for base in cls.__bases__ if base is not Task)
    header = f"class {cls.__name__}({bases}):" if bases else f"class {cls.__name__}:"
    shown = [inspect.getsource(vars(cls)[name]).rstrip() for name in _VISIBLE if name in vars(cls)]
    return "\n\n".join((header, *shown))
