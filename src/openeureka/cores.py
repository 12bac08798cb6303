"""Cores that this process may use."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

CGROUPS = Path("/sys/fs/cgroup")


def usable_cores() -> int:
    """Number of cores that this process may run on, or the CPU quota of its control groups, rounded up, where that is
    lower: as with `docker run --cpus=2` and under Kubernetes."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(cores, math.ceil(min(_quotas(), default=cores))))


def _quotas() -> Iterator[float]:
    """CPU quotas [cores] of this process's control groups and their parents. In a container its own may be the root."""
    for line in _lines(Path("/proc/self/cgroup")):
        number, controllers, group = line.split(":", 2)
        if number == "0":
            root, names = CGROUPS, ("cpu.max",)
        elif "cpu" in controllers.split(","):  # version 1 of control groups
            root, names = CGROUPS / "cpu", ("cpu.cfs_quota_us", "cpu.cfs_period_us")
        else:
            continue
        folder = root / group.lstrip("/")
        for place in (folder, *folder.parents):
            said = " ".join(line for name in names for line in _lines(place / name)).split()
            if place.is_relative_to(root) and len(said) == 2 and all(map(str.isdigit, said)):  # else no limit
                yield int(said[0]) / max(1, int(said[1]))


def _lines(file: Path) -> list[str]:
    try:
        return file.read_text().splitlines()
    except OSError:
        return []
