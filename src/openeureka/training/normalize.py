"""Running mean and variance, one per lane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

EPSILON = 1e-5
LIMIT = 5.0
ALL = slice(None)
"""Lanes."""


class RunningNorm:
    """Normalises the last axis with statistics of everything seen, separately for each lane.

    Statistics start as those of one sample with mean 0 and variance 1 (rl_games' convention).

    Args:
        lanes, size: L and the size D of the last axis.
    """

    def __init__(self, lanes: int, size: int, device: torch.device) -> None:
        self.mean = torch.zeros(lanes, 1, size, device=device)
        self.var = torch.ones(lanes, 1, size, device=device)
        self.count = torch.ones(lanes, 1, 1, device=device)

    def update(self, x: Tensor) -> None:
        """Take in x (L, B, D), by the parallel formula of Chan, Golub and LeVeque (1979)."""
        batch = x.shape[1]
        mean = x.mean(1, keepdim=True)
        var = (x - mean).square_().mean(1, keepdim=True)  # four times as fast as torch.var_mean on a CPU
        total = self.count + batch
        delta = mean - self.mean
        self.mean = self.mean + delta * (batch / total)
        self.var = (self.var * self.count + var * batch + delta**2 * (self.count * batch / total)) / total
        self.count = total

    def state_dict(self) -> dict[str, Any]:
        return {"mean": self.mean, "var": self.var, "count": self.count}

    def load_state_dict(self, saved: Mapping[str, Any]) -> None:
        self.mean, self.var, self.count = saved["mean"], saved["var"], saved["count"]

    def normalize(self, x: Tensor, lanes: slice = ALL) -> Tensor:
        """(L, B, D) of these lanes to zero mean and unit variance, clamped at +-5."""
        return normalize(x, self.mean[lanes], self.var[lanes])

    def denormalize(self, x: Tensor, lanes: slice = ALL) -> Tensor:
        """Back to the original scale (clamped at +-5 standard deviations)."""
        return x.clamp(-LIMIT, LIMIT) * torch.sqrt(self.var[lanes] + EPSILON) + self.mean[lanes]


def normalize(x: Tensor, mean: Tensor, var: Tensor) -> Tensor:
    """x in standard deviations from its mean, clamped at +-5."""
    # In place: a whole rollout of observations is too large for the allocator to keep, and new memory is slow.
    return (x - mean).mul_(torch.rsqrt(var + EPSILON)).clamp_(-LIMIT, LIMIT)
