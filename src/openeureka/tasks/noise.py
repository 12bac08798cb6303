"""Uniform noise that depends only on (seed, world, draw): a world's episodes are the same whatever runs beside it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

_GOLDEN = -7046029254386353131  # 2^64 / golden ratio, as signed int64: the increment of splitmix64


def _mix(x: Tensor) -> Tensor:
    """Finaliser of splitmix64 (Steele, Lea, Flood 2014) in wrapping int64 arithmetic."""
    x = (x ^ _shift(x, 30)) * -4658895280553007687
    x = (x ^ _shift(x, 27)) * -7723592293110705685
    return x ^ _shift(x, 31)


def _shift(x: Tensor, bits: int) -> Tensor:
    """Logical right shift of int64."""
    return (x >> bits) & ((1 << (64 - bits)) - 1)


class WorldNoise:
    """One counter-based stream per world.

    Worlds of lanes with equal seeds draw equal numbers, so candidates are compared on episodes with equal starts. Where
    a task also draws within an episode, such as random goals, this holds for the first episode only.

    Args:
        lane_seeds: one seed per lane, L.
        worlds: worlds per lane, n; world i of lane l is row l * n + i.

    Attributes:
        draws: (N,) int64, how often each world has drawn.
    """

    def __init__(self, lane_seeds: Sequence[int], worlds: int, device: torch.device) -> None:
        seeds = torch.tensor(lane_seeds, dtype=torch.int64, device=device).repeat_interleave(worlds)
        index = torch.arange(worlds, dtype=torch.int64, device=device).repeat(len(lane_seeds))
        self._key = _mix(_mix(seeds + _GOLDEN) + index * _GOLDEN)
        self.draws = torch.zeros_like(self._key)

    def uniform(self, worlds: Tensor, size: int, low: float | Tensor = 0.0, high: float | Tensor = 1.0) -> Tensor:
        """Draw (k, size) numbers in [low, high) for worlds (k,); `low` and `high` broadcast against (k, size)."""
        self.draws[worlds] += 1
        counter = _mix(self._key[worlds] + self.draws[worlds] * _GOLDEN)
        columns = torch.arange(1, size + 1, dtype=torch.int64, device=worlds.device)
        bits = _shift(_mix(counter[:, None] + columns * _GOLDEN), 40)
        return low + (high - low) * (bits.to(torch.float32) * 2.0**-24)
