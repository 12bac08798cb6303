"""ShadowHandSpin: a pen spun in the palm, from waypoint to waypoint; Eureka's demonstration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import mujoco

from ...tasks.task import Stage
from ...types import StateSpec
from ..isaac.shadow_hand import shadow_hand_variables
from .pen_in_hand import PenInHand, pen_scene


class ShadowHandSpin(PenInHand):
    env = "shadow_hand_spin"
    description = "to make the shadow hand spin the object to a target orientation"
    random_goals = False
    distance_weight = 0.1  # its sign is the published one
    object_start = (0.0, -0.39, 0.59)  # the original starts 7 cm lower, with the pen up to 2 cm inside palm and fingers
    goal_position = (0.0, -0.39, 0.48)
    spec = StateSpec(shadow_hand_variables("pen", "2 cm below the surface of the palm, which faces up"))
    curricula: ClassVar[Mapping[str, tuple[Stage, ...]]] = {
        "pen_spinning": (Stage(set={"random_goals": True}), Stage())
    }

    @staticmethod
    def model() -> mujoco.MjSpec:
        return pen_scene([1, 0, 0, 0], ShadowHandSpin.object_start, ShadowHandSpin.goal_position)
