"""Environment as context: what a language model reads of a task."""

from __future__ import annotations

from ..types import TaskContext
from .registry import get
from .source import prune


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
