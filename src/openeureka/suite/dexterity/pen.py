"""The hands pull the cap off a pen that lies on a table."""

from __future__ import annotations

import math

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .handles import HAND_VARIABLES, PALM_DOWN_LEFT, PALM_DOWN_RIGHT, PartedHandles, handles_apart
from .objects import CappedPen
from .scene import Placed, Pose, Scene, Table
from .variables import goal_variables, point_variables, thing_variables, two_handed

OFF = 0.3  # [m] between the points to grasp on cap and pen; 0.17 when closed
LYING = (math.pi / 2, math.pi / 2, 0)  # [rad] along y, cap towards +y


class ShadowHandPen(PartedHandles):
    env = "shadow_hand_pen"
    description = "to make the right hand pull the cap off the pen that the left hand holds"
    human = REWARDS / "shadow_hand_pen.py"
    episode_length = 125
    ends = (
        "An episode ends early when the distances of a hand's five fingertips from its point to grasp add up to 1.5 m."
    )
    num_observations = 417
    observed = ("pen_right_handle_pos", "pen_left_handle_pos")
    handles = ("pen_right_handle_pos", "pen_left_handle_pos")
    reach = 1.5
    scene = Scene(
        right=PALM_DOWN_RIGHT,
        left=PALM_DOWN_LEFT,
        hands_touch=True,
        table=Table(size=(0.5, 1, 0.6)),
        things={
            "object": Placed(
                thing=CappedPen(), pos=(0, 0, 0.612), euler=LYING, link_points={"pen_left_handle": (0, 0, 0.07)}
            )
        },
        goals={"goal": Pose(pos=(0, 0, 10.6), euler=LYING)},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "pen"),
        *goal_variables("unused, far above the pen", use="raw"),
        *HAND_VARIABLES,
        *point_variables("pen_right_handle", "point to grasp on the cap"),
        *point_variables("pen_left_handle", "point to grasp on the pen"),
        handles_apart("distance between the points to grasp on cap and pen [m], 0.17 while the cap is on"),
    )

    def success(self, s: State) -> Tensor:
        return self.handle_gap(s) > OFF
