"""Which devices a `device=` setting names, and the worker processes that share them."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from ..sim import check_device
from ..worker import usable_cores
from .transport import Slot

CPU = "cpu"
CPU_WORKERS = 8
"""The most processes that share one CPU: each costs 0.4 GB of memory before its worlds."""


def devices(setting: str) -> tuple[str, ...]:
    """One name for each worker process: `cuda` is every GPU that this process sees; several names stand between commas.

    Raises:
        ConfigError: when this machine lacks one of them.
    """
    found: list[str] = []
    for name in setting.split(","):
        check_device(name.strip())
        # Counting does not initialise CUDA: the memory that costs belongs to the workers.
        gpus = [f"cuda:{index}" for index in range(torch.cuda.device_count())]
        found += gpus if name.strip() == "cuda" else [name.strip()]
    return tuple(found)


def workers(devices: Sequence[str], threads: int, populations: int) -> tuple[Slot, ...]:
    """A slot for each worker process, where up to so many populations can train side by side.

    On one CPU they get a process each, as far as there are cores: while the small operations of one population keep a
    single core busy, the others need not wait.

    Args:
        threads: of all workers on a CPU together, or of each worker where several devices are named; 0 for all cores.
    """
    if tuple(devices) != (CPU,):
        return tuple(Slot(device, threads) for device in devices)
    available = threads or usable_cores()
    count = max(1, min(available, populations, CPU_WORKERS))
    return (Slot(CPU, available // count),) * count
