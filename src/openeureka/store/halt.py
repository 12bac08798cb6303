"""Asking a run to stop that another process works on: by a file, which also reaches it on another machine."""

from __future__ import annotations

from pathlib import Path

from ..errors import StoreError
from . import artifacts
from .db import STOP, explained
from .recover import is_held, is_run


def ask_to_stop(directory: Path | str) -> None:
    """Ask the process that works on a run to stop as by Ctrl-C; it does within a second.

    Raises:
        StoreError: when there is no run, or nobody works on it.
    """
    directory = Path(directory)
    if not is_run(directory):
        raise StoreError(f"{directory} is not a run; name the directory that `eureka run` printed.")
    if not is_held(directory):
        raise StoreError(f"Nobody works on {directory}, so there is nothing to stop.")
    with explained(directory):
        artifacts.appended(directory, STOP).close()


def is_asked_to_stop(directory: Path) -> bool:
    return artifacts.exists(directory, STOP)


def withdraw(directory: Path) -> None:
    """Forget a request: it was followed, or came when nobody worked on the run any more."""
    with explained(directory):
        (directory / STOP).unlink(missing_ok=True)
