"""Processor time of a sandbox: what else the machine does is no part of it."""

from __future__ import annotations

import os
from pathlib import Path

from openeureka.sandbox.client import Sandbox


def processor_seconds(sandbox: Sandbox) -> float:
    """What its server has used so far, and every child of it that has ended."""
    assert sandbox._worker is not None
    stat = Path(f"/proc/{sandbox._worker.process.pid}/stat").read_text()
    user, system, *children = map(int, stat.rpartition(")")[2].split()[11:15])
    return (user + system + sum(children)) / os.sysconf("SC_CLK_TCK")
