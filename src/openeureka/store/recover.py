"""What other runs want of a finished or interrupted one."""

from __future__ import annotations

import fcntl
from pathlib import Path

from ..config import RunConfig
from ..types import Remark, Reply
from . import artifacts
from .db import FILENAME, LOCK
from .store import Store


def read_config(directory: Path | str) -> RunConfig:
    """The settings a run began with, for `eureka resume`. Raises StoreError when there is no run."""
    with Store.view(directory) as store:
        return store.config


def read_replies(directory: Path | str) -> tuple[Reply, ...]:
    """Every reply of a run in the order in which the same search asks for them, for `model=replay:DIR`.

    A replaying run that is itself resumed skips as many as its own store already holds.
    """
    with Store.view(directory) as store:
        return store.replies()


def read_remarks(directory: Path | str) -> dict[int, tuple[Remark, ...]]:
    """What a person said of a run, by the generation after which it was heard, for `model=replay:DIR`."""
    with Store.view(directory) as store:
        return {generation.index: generation.remarks for generation in store.history().generations}


def is_run(directory: Path | str) -> bool:
    """Whether a run began in the directory."""
    return (Path(directory) / FILENAME).is_file()


def is_held(directory: Path | str) -> bool:
    """Whether a process is working on the run."""
    try:
        file = artifacts.opened(Path(directory), LOCK)
    except OSError:
        return False
    if file is None:
        return False
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
