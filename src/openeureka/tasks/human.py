"""The human reward of a task as a program that a model can read."""

from __future__ import annotations

from ..errors import TaskError


def program(env: str) -> str:
    raise TaskError(f"The human reward of {env} cannot be written as a program; name a file, as in init=path.py.")
