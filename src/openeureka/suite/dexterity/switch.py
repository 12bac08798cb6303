"""Each hand presses down the raised end of a rocker switch."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .handles import HAND_VARIABLES, PALM_DOWN_LEFT, PALM_DOWN_RIGHT, Handles
from .objects import RockerSwitch
from .scene import Placed, Pose, Scene, Table
from .variables import goal_variables, point_variables, thing_variables, two_handed

RAISED = 0.5585  # [rad] of a rocker: its end at the hand is up
FACE_UP = (math.pi, math.pi / 2, 0)


class ShadowHandSwitch(Handles):
    """The rockers start raised, so that there is something to press; they rise again by their own weight."""

    env = "shadow_hand_switch"
    description = "to make each hand press down the switch in front of it"
    human = REWARDS / "shadow_hand_switch.py"
    episode_length = 125
    num_observations = 417
    observed = ("switch_right_handle_pos", "switch_left_handle_pos")
    handles = ("switch_right_handle_pos", "switch_left_handle_pos")
    pressed: ClassVar[float] = 0.012
    """How far the two ends must be below 0.7 m, summed [m]: -0.005 when raised, 0.017 at the lower stops."""
    scene = Scene(
        right=PALM_DOWN_RIGHT,
        left=PALM_DOWN_LEFT,
        hands_touch=True,
        table=Table(size=(0.5, 1, 0.55)),
        things={
            "object": Placed(thing=RockerSwitch(side="right"), pos=(0, 0.2, 0.65), euler=FACE_UP, fixed=True),
            "switch_left": Placed(thing=RockerSwitch(side="left"), pos=(0, -0.2, 0.65), euler=FACE_UP, fixed=True),
        },
        goals={"goal": Pose(pos=(0, 0.2, 10.65), euler=FACE_UP)},
        angles={"switch_right_rocker": RAISED, "switch_left_rocker": RAISED},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "housing of the right switch, which is fixed at (0, 0.2, 0.65)", fixed=True),
        *goal_variables("unused, far above the switches", use="raw"),
        *HAND_VARIABLES,
        *point_variables("switch_right_handle", "end of the right switch to press, which sinks by about 1 cm"),
        *point_variables("switch_left_handle", "end of the left switch to press, which sinks by about 1 cm"),
    )

    def success(self, s: State) -> Tensor:
        sunk = 1.4 - s["switch_right_handle_pos"][:, 2] - s["switch_left_handle_pos"][:, 2]  # [m]
        return sunk > self.pressed


class ShadowHandSwitchAsPublished(ShadowHandSwitch):
    """With the original's start and threshold, which its rockers cannot reach; to be named by its import string."""

    pressed = 0.05
    scene = replace(ShadowHandSwitch.scene, angles={})
