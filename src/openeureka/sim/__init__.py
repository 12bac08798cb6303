"""Batched physics."""

from __future__ import annotations

import re
from importlib.util import find_spec

import torch

from ..errors import ConfigError
from ..opengl import mujoco
from .base import GUESS, Capacity, Simulator, Worlds, capacity
from .cpu import CpuSimulator

__all__ = ["CpuSimulator", "Simulator", "Worlds", "check_device", "open_simulator"]

DEVICES = "cpu, cuda, cuda:1 (any GPU by its number) or warp-cpu (the GPU simulator on the CPU, for tests)"


def check_device(device: str) -> None:
    """Raises ConfigError unless this machine can simulate on the device. Starts nothing on a GPU."""
    if not re.fullmatch(r"cpu|warp-cpu|cuda(:\d+)?", device):
        raise ConfigError(f"There is no device `{device}`; `device` takes {DEVICES}.")
    if device == "cpu":
        return
    if find_spec("mujoco_warp") is None:
        raise ConfigError(f"device={device} needs MuJoCo Warp: pip install 'openeureka[gpu]', or use device=cpu.")
    if device == "warp-cpu":
        return
    gpus = torch.cuda.device_count()  # does not initialise CUDA
    seen = f"torch sees {gpus} GPU{'s' if gpus > 1 else ''}"
    if not gpus:
        raise ConfigError(f"device={device} needs an NVIDIA GPU that torch can use, but there is none; use device=cpu.")
    if int(device.partition(":")[2] or 0) >= gpus:
        raise ConfigError(f"There is no device {device}: {seen}.")
    if (usable := _warp_gpus()) < gpus:
        raise ConfigError(
            f"device={device} needs a newer NVIDIA driver: {seen}, but MuJoCo Warp can use {usable or 'none'}; update "
            "the driver, or use device=cpu."
        )


def _warp_gpus() -> int:
    """Number of GPUs whose driver is new enough for Warp. Takes no memory on them."""
    import warp  # pyright: ignore[reportMissingImports]  # an optional package that takes seconds

    warp.config.log_level = warp.LOG_ERROR  # else it greets, and says in several lines what `check_device` says in one
    return warp.get_cuda_device_count()


def open_simulator(
    model: mujoco.MjModel, num_worlds: int, *, device: str = "cpu", threads: int = 0, room: Capacity = GUESS
) -> Simulator:
    """The simulator of a device.

    Args:
        device: see `check_device`.
        threads: size of the thread pool, 0 for all cores; only for `cpu`.
        room: contacts and constraints of a world, 0 for a guess; only for the GPU simulator.

    Raises:
        ConfigError: when this machine does not have that device.
    """
    check_device(device)
    if device == "cpu":
        return CpuSimulator(model, num_worlds, threads)
    from .warp import WarpSimulator  # imports an optional package, which takes seconds

    name = {"warp-cpu": "cpu", "cuda": "cuda:0"}.get(device, device)
    return WarpSimulator(model, num_worlds, name, capacity(model, room))
