"""Whether processes live, by what the kernel says of them."""

from __future__ import annotations

import time
from pathlib import Path


def running(pid: int) -> bool:
    """Whether a process lives. One that has ended and waits to be reaped does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):  # the latter if it ends while its file is read
        return False


def ends(pid: int) -> bool:
    """Whether a process ends, even on a busy machine."""
    end = time.monotonic() + 300
    while running(pid) and time.monotonic() < end:
        time.sleep(0.05)
    return not running(pid)
