"""Which devices a `device=` setting names."""

from __future__ import annotations

import torch

from ..sim import check_device


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
