"""The hands take a cup by its two handles and turn it by half a turn."""

from __future__ import annotations

import math
from collections.abc import Mapping

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .handles import HAND_VARIABLES, Handles
from .objects import Cup
from .scene import Placed, Pose, Scene, Table
from .variables import ROTATION_DISTANCE, goal_variables, point_variables, thing_variables, two_handed

TURNED = 0.785  # [rad] between cup and goal
SHOWN_AT = 1.0  # [m] height of the goal in pictures


class ShadowHandSwingCup(Handles):
    env = "shadow_hand_swing_cup"
    description = "to make the two hands grasp the cup by its two handles and turn it by 180 degrees"
    human = REWARDS / "shadow_hand_swing_cup.py"
    episode_length = 150
    ends = "An episode ends early when the cup falls to a height of 0.3 m."
    num_observations = 417
    observed = ("cup_right_handle_pos", "cup_left_handle_pos")
    handles = ("cup_right_handle_pos", "cup_left_handle_pos")
    scene = Scene(
        right=Pose(pos=(0.35, 0.2, 0.8), euler=(math.pi, 1.57, 1.57)),
        left=Pose(pos=(0.35, -0.2, 0.8), euler=(math.pi, -1.57, 1.57)),
        hands_touch=True,
        table=Table(size=(0.3, 0.3, 0.6)),
        things={
            "object": Placed(
                thing=Cup(),
                pos=(0, 0, 0.685),
                euler=(0, 0, math.pi / 2),
                points={"cup_right_handle": (0.062, 0, 0)},
                link_points={"cup_left_handle": (-0.06, 0, 0)},
            )
        },
        goals={"goal": Pose(pos=(0, 0, 1.6), euler=(0, 0, 1.5 * math.pi))},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "cup"),
        *goal_variables("orientation the cup should be turned to, far above it", use="raw"),
        ROTATION_DISTANCE,
        *HAND_VARIABLES,
        *point_variables("cup_right_handle", "right handle of the cup"),
        *point_variables("cup_left_handle", "left handle of the cup"),
    )

    def ghosts(self) -> Mapping[str, Tensor]:
        """The turned cup, above the cup."""
        pose = self.goal_poses[:, 0].clone()
        pose[:, 2] = SHOWN_AT
        return {"object": pose}

    def terminated(self, s: State) -> Tensor:
        return s["object_pos"][:, 2] <= 0.3

    def success(self, s: State) -> Tensor:
        return s["rotation_distance"] < TURNED
