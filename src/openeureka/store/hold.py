"""Who works on a run: one process at a time, and on which machine."""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path

from filelock import FileLock, Timeout

from ..errors import StoreError
from ..parsing import short_path
from ..text import one_line
from . import artifacts
from .db import LOCK, at_work, explained

LOOK_TIME = 0.5
"""[s] to wait for the lock: who only asks whether the run is at work (`is_held`) has it for microseconds."""
_BOOT = Path("/proc/sys/kernel/random/boot_id")
"""Names the kernel that runs: containers of one machine share it, and its memory, whatever they call themselves."""


def hold(directory: Path) -> FileLock:
    """The lock of a run, whose directory is made, taken; its file says by which machine.

    Raises:
        StoreError: when another process has it, or the file system has no locks.
    """
    artifacts.expect_regular(directory, LOCK)
    with explained(directory):
        directory.mkdir(parents=True, exist_ok=True)
        # A lock of another kind, which filelock would fall back to, outlives a process that is killed.
        lock = FileLock(directory / LOCK, timeout=LOOK_TIME, fallback_to_soft=False)
        try:
            lock.acquire()
        except Timeout:
            raise at_work(directory) from None
        try:
            with open(os.open(directory / LOCK, os.O_WRONLY | os.O_TRUNC | os.O_NOFOLLOW), "w") as file:
                file.write(f"{_boot()} {os.uname().nodename}\n")
        except BaseException:
            lock.release()
            raise
    return lock


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
        except (BlockingIOError, PermissionError):  # some file systems say the latter
            return True
        except OSError:  # without locks, where no run can be at work
            return False
    return False


def expect_near(directory: Path) -> None:
    """Refuse to open the rows of a run that is at work on another machine, which shares the disk.

    SQLite keeps the index of its log in memory that processes of one machine share: from another, rows would seem to be
    missing or damaged, and what is written could damage them. Raises StoreError.
    """
    with suppress(OSError):
        file = artifacts.opened(directory, LOCK)
        if file is None:
            return
        with file:
            boot, _, host = file.read(400).decode(errors="replace").rstrip("\n").partition(" ")
        own = _boot()
        if boot and own and boot != own and is_held(directory):
            raise StoreError(
                f"{short_path(directory)} is at work on {one_line(host)}, and its rows can be opened on that machine "
                "alone: open it there, or when the run has stopped."
            )


def _boot() -> str:
    """Empty where it is hidden, as by systemd's ProcSubset=pid."""
    with suppress(OSError):
        return _BOOT.read_text().strip()
    return ""
