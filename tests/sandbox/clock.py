"""Processor time of a sandbox, which does not depend on what else the machine does."""

from __future__ import annotations

import os
from pathlib import Path

from openeureka.sandbox.client import Sandbox


def processor_seconds(sandbox: Sandbox) -> float:
    """Processor time of the sandbox's server so far, and of its children that have ended [s]."""
    assert sandbox._worker is not None
    stat = Path(f"/proc/{sandbox._worker.process.pid}/stat").read_text()
    user, system, *children = map(int, stat.rpartition(")")[2].split()[11:15])
    return (user + system + sum(children)) / os.sysconf("SC_CLK_TCK")
