"""ShadowHandUpsideDown: a pen turned to random orientations below a hand whose palm faces down."""

from __future__ import annotations

import mujoco

from ...types import StateSpec
from ..isaac.shadow_hand import shadow_hand_variables
from .pen_in_hand import PenInHand, pen_scene


class ShadowHandUpsideDown(PenInHand):
    env = "shadow_hand_upside_down"
    description = "to make the shadow hand spin the object to a target orientation"
    random_goals = True
    distance_weight = -10.0
    object_start = (0.0, -0.39, 0.41)  # the original starts 7 cm higher, with the pen up to 2 cm inside the fingers
    goal_position = (0.0, -0.39, 0.44)
    spec = StateSpec(shadow_hand_variables("pen", "6 cm below the palm, which faces down"))

    @staticmethod
    def model() -> mujoco.MjSpec:
        half_a_turn_about_y = [0, 0, 1, 0]
        return pen_scene(half_a_turn_about_y, ShadowHandUpsideDown.object_start, ShadowHandUpsideDown.goal_position)
