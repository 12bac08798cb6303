"""Which devices a `device=` setting names."""

from __future__ import annotations

import torch

from ..errors import ConfigError


def devices(setting: str) -> tuple[str, ...]:
    """One name for each worker process: `cuda` is every GPU that this process sees, `cuda:1` that one; several names
    stand between commas.

    Raises:
        ConfigError: when there is no such device.
    """
    named = [name.strip() for name in setting.split(",") if name.strip()]
    if not named:
        raise ConfigError("`device` names nothing, write for example device=cpu or device=cuda.")
    # Counting does not initialise CUDA: the memory that costs belongs to the workers.
    count = torch.cuda.device_count()
    gpus = [f"cuda:{index}" for index in range(count)]
    for name in named:
        if name.startswith("cuda") and name not in ("cuda", *gpus):
            raise ConfigError(f"There is no device {name}: this process sees {_counted(count)}.")
        if name == "cuda" and not gpus:
            raise ConfigError("device=cuda needs an NVIDIA GPU that torch can use, and there is none; use device=cpu.")
    return tuple(device for name in named for device in (gpus if name == "cuda" else [name]))


def _counted(gpus: int) -> str:
    return "no GPU" if gpus == 0 else "1 GPU" if gpus == 1 else f"{gpus} GPUs"
