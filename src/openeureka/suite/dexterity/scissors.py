"""The hands open a pair of scissors that lies closed on a table."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...tasks.rotations import conjugate, multiply
from ...tasks.task import State
from ..assets import REWARDS
from .handles import HAND_VARIABLES, PALM_DOWN_LEFT, PALM_DOWN_RIGHT, PartedHandles, handles_apart
from .objects import Scissors
from .scene import Placed, Pose, Scene, Table
from .variables import goal_variables, point_variables, thing_variables, two_handed

CLOSED, OPEN = -0.59, -0.3  # [rad]
CRUSHED = -0.69  # [rad] beyond the joint limit, which is soft
NEAR = 0.7  # [m] summed over the fingers of a hand


class ShadowHandScissors(PartedHandles):
    env = "shadow_hand_scissors"
    description = "to make the two hands open the scissors by pulling their handles apart"
    human = REWARDS / "shadow_hand_scissors.py"
    episode_length = 150
    ends = (
        "An episode ends early when the distances of a hand's five fingertips from its handle add up to 1.75 m, or "
        "when those of each hand add up to less than 0.7 m and the blades are pressed past closed, the hinge below "
        "-0.69 rad."
    )
    num_observations = 417
    observed = ("scissors_right_handle_pos", "scissors_left_handle_pos")
    handles = ("scissors_right_handle_pos", "scissors_left_handle_pos")
    reach = 1.75
    scene = Scene(
        right=PALM_DOWN_RIGHT,
        left=PALM_DOWN_LEFT,
        hands_touch=True,
        table=Table(size=(0.5, 1, 0.6)),
        things={"object": Placed(thing=Scissors(), pos=(0, 0, 0.608), euler=(0, 0, math.pi / 2))},
        goals={"goal": Pose(pos=(0, 0, 10.6), euler=(0, 0, math.pi / 2))},
        angles={"scissors_hinge": CLOSED},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "left half of the scissors"),
        *goal_variables("unused, far above the scissors", use="raw"),
        *HAND_VARIABLES,
        *point_variables("scissors_right_handle", "handle of the right half"),
        *point_variables("scissors_left_handle", "handle of the left half"),
        handles_apart("distance between the handles [m], 0.07 when closed and 0.28 when wide open"),
    )

    def terminated(self, s: State) -> Tensor:
        crushed = (torch.maximum(*self.reaches(s)) < NEAR) & (self._angle(s) < CRUSHED)
        return super().terminated(s) | crushed

    def success(self, s: State) -> Tensor:
        return self._angle(s) > OPEN

    def _angle(self, s: State) -> Tensor:
        """(N,) [rad] of the hinge, which turns the right half about the y axis of the left handle."""
        turn = multiply(conjugate(s["scissors_left_handle_rot"]), s["scissors_right_handle_rot"])
        return 2.0 * torch.atan(turn[:, 1] / turn[:, 3])
