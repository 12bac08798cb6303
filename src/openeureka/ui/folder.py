"""The runs below a folder, how far each has come, and whether anything about one has changed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from ..config import RunConfig
from ..errors import StoreError
from ..report.view import FOLDERS, RunView
from ..store import artifacts, is_held, is_run, look
from ..store.db import FILENAME, LOG, NOW
from ..text import safe_text
from ..types import Glance
from .follow import Fingerprint


class RunState(StrEnum):
    """What a run is doing."""

    RUNNING = "running"
    FINISHED = "finished"
    STOPPED = "stopped"  # `eureka resume` continues it
    UNBEGUN = "not begun"  # started from the page; its log says why
    UNREADABLE = "unreadable"  # damaged, or of a newer version


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A run in the list."""

    name: str
    state: RunState
    config: RunConfig | None = None
    """None, as `glance`, where the run cannot be read."""
    glance: Glance | None = None
    problem: str = ""


DEPTH = 3
"""Levels of folders that are searched for runs: a bench keeps the runs of its cells in its own folder."""
_CHANGING = (FILENAME, f"{FILENAME}-wal", LOG)


def runs(root: Path) -> dict[str, Path]:
    """The directories of runs by name, the one that changed last first. Where `root` is a run itself, it is the only
    one. Runs in subfolders are called `folder:run`; a colon in a name is doubled."""
    if is_run(root):
        return {root.resolve().name: root}
    found = sorted(_below(root, DEPTH), key=_changed, reverse=True)
    parts = {path: [part.replace(":", "::") for part in path.relative_to(root).parts] for path in found}
    return {safe_text(":".join(names)): path for path, names in parts.items()}


def _below(root: Path, depth: int) -> Iterator[Path]:
    """Runs, and directories in which the page has started a run that has not begun yet.

    Runs are not searched, since a run holds no others. Links are not followed: they may lead anywhere.
    """
    try:
        found = [path for path in root.iterdir() if os.path.isdir(path)]  # `Path.is_dir` raises if unreadable
    except OSError:  # no directory, deleted since, or not readable
        return
    for path in found:
        if is_run(path) or os.path.isfile(path / LOG):
            yield path
        elif depth > 1 and not path.is_symlink():
            yield from _below(path, depth - 1)


def _changed(directory: Path) -> tuple[int, str]:
    return max(_stat(directory / name)[0] for name in _CHANGING), directory.name


def glanced(directory: Path) -> Fingerprint:
    """Differs after every commit, and when a process begins or ends: all that the list shows depends on these."""
    changing = (_stat(directory / name) for name in (FILENAME, f"{FILENAME}-wal"))
    return (is_held(directory), *changing)


def fingerprint(directory: Path) -> Fingerprint:
    """Differs after every commit, film, line of the log and end of the process; costs a stat for each lane.

    Files are replaced by renaming, which changes the time of their folder: a stat of the folder is enough.
    """
    files = [directory / name for name in (*_CHANGING, *FOLDERS)]
    with suppress(OSError):  # there is none, or it may not be read
        files += (directory / "lanes").iterdir()
    return (is_held(directory), *sorted((path.name, *_stat(path)) for path in files))


def moment(directory: Path) -> Fingerprint:
    """Differs when the run has rewritten `run.now.json`."""
    return _stat(directory / NOW)


def _stat(path: Path) -> tuple[int, int]:
    """Modification time [ns] and size [B] of a file; zeros where it is gone, or a link to nowhere."""
    try:
        found = os.stat(path)
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def listed(name: str, directory: Path) -> Entry:
    """The run's line in the list. A search of an older version kept no word: then the whole run is read for it, which
    takes 0.1 to 0.5 s."""
    found = entry(name, directory)
    config, glance = found.config, found.glance
    if found.state is RunState.FINISHED and config and config.generations and glance and not glance.word:
        with suppress(StoreError):
            if (outcome := RunView.read(directory).outcome) is not None:
                return replace(found, glance=replace(glance, word=outcome.word))
    return found


def entry(name: str, directory: Path) -> Entry:
    """How far a run has come, at a glance."""
    if not is_run(directory):
        return Entry(name=name, state=RunState.UNBEGUN)
    held = is_held(directory)
    try:
        config, glance = look(directory)
    except StoreError as error:
        return Entry(name=name, state=RunState.RUNNING if held else RunState.UNREADABLE, problem=str(error))
    left = RunState.FINISHED if glance.ended else RunState.STOPPED
    state = RunState.RUNNING if held else left
    return Entry(name=name, state=state, config=config, glance=glance)


def log(directory: Path, lines: int = 15, size: int = 4000) -> str:
    """The last lines of a run's log, at most `size` bytes; none where it may not be read."""
    try:
        file = artifacts.opened(directory, LOG)
    except OSError:
        return ""
    if file is None:
        return ""
    with file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - size))
        text = file.read().decode(errors="replace")
    return "".join(text.splitlines(keepends=True)[-lines:])
