"""The hands take a pot by its handles, from both sides, and lift it off the table."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...tasks.task import State
from ...types import StateVar
from ..assets import REWARDS
from .common import TwoHands, distance
from .objects import Pot
from .scene import SIDES, Placed, Pose, Scene, Table
from .variables import FINGERTIPS, PALMS, goal_variables, thing_variables, two_handed

LIFTED = 0.05  # [m] between pot and goal


class ShadowHandLiftUnderarm(TwoHands):
    env = "shadow_hand_lift_underarm"
    description = "to make the two hands grip the pot by its handles and lift it to the goal above the table"
    human = REWARDS / "shadow_hand_lift_underarm.py"
    episode_length = 500
    ends = "An episode ends early when the pot falls to a height of 0.3 m, or a palm is 0.2 m from its handle."
    num_observations = 417
    observed = ("pot_right_handle_pos", "pot_left_handle_pos")
    transition_scale = 0.25
    orientation_scale = 1.0
    scene = Scene(
        right=Pose(pos=(0, 0.05, 0.45)),
        left=Pose(pos=(0, -1.25, 0.45), euler=(0, 0, math.pi)),
        hands_touch=True,
        table=Table(size=(0.3, 0.3, 0.4), centre=(0, -0.6), friction=3.0),
        things={
            "object": Placed(
                thing=Pot(),
                pos=(0, -0.6, 0.465),  # 0.45 in the original, inside the table
                points={"pot_right_handle": (0, 0.15, 0.06), "pot_left_handle": (0, -0.15, 0.06)},
            )
        },
        goals={"goal": Pose(pos=(0, -0.6, 0.85))},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "pot"),
        *goal_variables("where the pot should be lifted to"),
        *FINGERTIPS,
        *PALMS,
        *(
            StateVar(
                f"pot_{side}_handle_pos",
                f"handle of the pot for the {side} hand: position [m], world frame",
                (3,),
                use="point",
            )
            for side in SIDES
        ),
    )

    def terminated(self, s: State) -> Tensor:
        right = distance(s["right_hand_pos"], s["pot_right_handle_pos"])
        left = distance(s["left_hand_pos"], s["pot_left_handle_pos"])
        return (s["object_pos"][:, 2] <= 0.3) | (torch.maximum(right, left) >= 0.2)

    def success(self, s: State) -> Tensor:
        return distance(s["object_pos"], s["goal_pos"]) < LIFTED
