"""Joint angles in their ranges, and turns as quaternions."""

from __future__ import annotations

import math

from torch import Tensor


def scaled(angle: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Map joint angles from [lower, upper] to [-1, 1]."""
    return (2.0 * angle - upper - lower) / (upper - lower)


def unscaled(value: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """Inverse of `scaled`."""
    return lower + 0.5 * (value + 1.0) * (upper - lower)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Turn [rad] about x, then y, then z of the world, w x y z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
