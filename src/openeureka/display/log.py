"""`run.log`: what a run prints, for people who look at its directory and not at its terminal."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from rich.console import Console

from ..config import RunConfig
from ..errors import EurekaError, StoreError
from ..events import Tell
from ..store import artifacts
from ..store.db import LOG, NOW
from ..text import plain
from ..types import Usage
from .live import PlainView
from .now import Recorder

WIDTH = 120


class _LogFile(io.TextIOWrapper):
    """Ignores a full disk: a search does not stop for its log, and the store will report it."""

    def write(self, text: str) -> int:
        with suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            super().flush()

    def close(self) -> None:
        with suppress(OSError):
            super().close()


@contextmanager
def logged(directory: Path, config: RunConfig, usage: Usage) -> Iterator[list[Tell]]:
    """Listeners that write `run.now.json` while the run is at work, and `run.log`, where that can be written and the
    process does not print to it already."""
    recorder = Recorder(directory, config, usage)
    try:
        with _lines(directory, config, usage) as lines:
            yield [recorder, *lines]
    finally:
        with suppress(StoreError):
            artifacts.remove(directory, NOW)


@contextmanager
def _lines(directory: Path, config: RunConfig, usage: Usage) -> Iterator[list[Tell]]:
    raw = _opened(directory)
    if raw is None:
        yield []
        return
    with _LogFile(raw, encoding="utf-8") as file:
        try:
            yield [PlainView(Console(file=file, width=WIDTH, force_terminal=False), config, usage)]
        except EurekaError as error:
            print(plain(str(error)), file=file)
            raise
        except KeyboardInterrupt:
            print("Stopped", file=file)
            raise


def _opened(directory: Path) -> BinaryIO | None:
    try:
        file = artifacts.appended(directory, LOG)
    except (OSError, StoreError):
        return None
    with suppress(OSError):  # no stdout
        if os.path.samestat(os.fstat(1), os.fstat(file.fileno())):  # `eureka ui` starts runs like that
            file.close()
            return None
    return file
