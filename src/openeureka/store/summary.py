"""A summary of how far a run has come, in a file beside its rows: a list of many runs opens no database.

It records the time and size of the database that it was made from. Where the database has changed since, as in a copy
or after a kill, the rows are read.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from ..codec import DecodeError, decode, encode
from ..config import RunConfig
from ..errors import ConfigError, StoreError
from ..parsing import restored
from ..types import Glance
from . import artifacts
from .db import FILENAME, SUMMARY

_LARGEST = 1 << 16
"""Largest summary that is read [bytes]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kept:
    """A summary as it is stored."""

    rows: tuple[int, int]
    """When the database was last changed [ns], and its size [B]."""
    config: dict[str, object]
    glance: Glance


def keep(directory: Path, config: RunConfig, glance: Glance) -> None:
    """Write the summary, once the database is closed. Where that fails, `read` finds none and the rows are read."""
    rows = _of(directory)
    if rows is not None:
        with suppress(StoreError):
            artifacts.write(directory, SUMMARY, encode(_Kept(rows=rows, config=asdict(config), glance=glance)))


def read(directory: Path) -> tuple[RunConfig, Glance] | None:
    """The settings of a run and how far it has come; None where the rows have to be read."""
    with suppress(StoreError, ConfigError, DecodeError, TypeError, OSError):
        file = artifacts.opened(directory, SUMMARY)
        if file is not None:
            with file:
                kept = decode(_Kept, file.read(_LARGEST))
            if kept.rows == _of(directory):
                return restored(RunConfig, kept.config), kept.glance
    return None


def _of(directory: Path) -> tuple[int, int] | None:
    """The database's time [ns] and size [B]; None while a write-ahead log lies beside it."""
    with suppress(OSError):
        if not os.path.lexists(directory / f"{FILENAME}-wal"):
            found = os.lstat(directory / FILENAME)
            return found.st_mtime_ns, found.st_size
    return None
