"""The lock of a run: one process at a time works on it, and the lock file names its machine."""

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
"""[s] to wait for the lock: `is_held` takes it for microseconds, only to see whether the run is at work."""
_BOOT = Path("/proc/sys/kernel/random/boot_id")
"""Identifies the running kernel. Containers of one machine share it and its memory, whatever their host names."""


def hold(directory: Path) -> FileLock:
    """Make the directory of a run where it is missing, take its lock, and name this machine in the lock file.

    Raises:
        StoreError: when another process holds the lock, or the file system has no locks.
    """
    artifacts.expect_regular(directory, LOCK)
    with explained(directory):
        directory.mkdir(parents=True, exist_ok=True)
        # filelock would fall back to a soft lock, which outlives a process that is killed.
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
        except (BlockingIOError, PermissionError):  # some file systems raise the latter
            return True
        except OSError:  # a file system without locks, where no run can be at work
            return False
    return False


def expect_near(directory: Path) -> None:
    """Refuse to open the rows of a run that another machine, which shares the disk, is working on.

    SQLite keeps the index of its log in memory that only processes of one machine share. From another machine rows
    would seem to be missing or damaged, and a write could damage them. Raises StoreError.
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
                f"{short_path(directory)} is running on {one_line(host)}, and until it stops its rows can be opened "
                "only on that machine. Open it there, or wait until it has stopped."
            )


def _boot() -> str:
    """The boot id of the kernel; empty where /proc hides it, as with systemd's ProcSubset=pid."""
    with suppress(OSError):
        return _BOOT.read_text().strip()
    return ""
