"""Quaternions of roll, pitch and yaw."""

from __future__ import annotations

import math


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Turn [rad] about x, then y, then z of the world, w x y z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
