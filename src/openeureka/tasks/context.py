"""Environment as context: what a language model reads of a task."""

from __future__ import annotations

import ast

from ..types import TaskContext
from .registry import get
from .task import Task

# An allow-list, so that nothing a task adds later (fitness, rewards, thresholds, training defaults) leaks by default.
_VISIBLE = ("apply_action", "compute_state", "observe")


def context(env: str) -> TaskContext:
    """Description, state table and pruned source of a task."""
    task = get(env)
    return TaskContext(env=env, description=task.description, state=task.spec, source=prune(task))


def prune(task: type[Task]) -> str:
    """The task's class with only the methods that turn actions into motion and motion into state."""
    text = task.source()
    for node in ast.parse(text).body:
        if isinstance(node, ast.ClassDef) and node.name == task.__name__:
            methods = [part for part in node.body if isinstance(part, ast.FunctionDef) and part.name in _VISIBLE]
            shown = [ast.get_source_segment(text, method, padded=True) or "" for method in methods]
            return "\n\n".join([f"class {task.__name__}:", *shown])
    raise LookupError(f"{task.__name__} is not defined at the top level of its module")
