"""Joint angles and their ranges."""

from __future__ import annotations

from torch import Tensor


def scaled(angle: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Map joint angles from [lower, upper] to [-1, 1]."""
    return (2.0 * angle - upper - lower) / (upper - lower)


def unscaled(value: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Inverse of `scaled`."""
    return lower + 0.5 * (value + 1.0) * (upper - lower)
