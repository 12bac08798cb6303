"""What a policy costs beside its score: quantities of the robot, and limits to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Cost(NamedTuple):
    """A quantity of a robot at work; less is better."""

    unit: str
    meaning: str


COSTS: Mapping[str, Cost] = {
    "torque": Cost("N m", "largest torque of a driven joint, mean over steps"),
    "torque_peak": Cost("N m", "largest torque of a driven joint in an episode, mean over episodes"),
    "torque_rate": Cost("N m/s", "fastest change of a driven joint's torque, mean over steps"),
    "joint_limits": Cost("share", "steps in which a driven joint is at an end of its range"),
    "speed": Cost("rad/s", "fastest driven joint, mean over steps"),
    "power": Cost("W", "torque times rate of all driven joints, whichever its sign, mean over steps"),
    "contact_force": Cost("N", "largest net force of all contacts on the robot in an episode, mean over episodes"),
    "falls": Cost("share", "episodes that end early"),
}
"""By name. Joints that slide are measured in N, N/s and m/s."""

Limits = Mapping[str, float]
"""The most of each named cost that a policy may have."""
