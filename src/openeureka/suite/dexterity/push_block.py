"""Each hand pushes a cube forward on a table, to the cube's own target."""

from __future__ import annotations

import torch
from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .common import distance
from .handles import HAND_VARIABLES, PALM_DOWN_LEFT, PALM_DOWN_RIGHT, Handles
from .objects import CUBE_START, Cube
from .scene import Placed, Pose, Scene, Table
from .variables import point_variables, thing_variables, two_handed

ARRIVED = 0.1  # [m] between a cube and its target


class ShadowHandPushBlock(Handles):
    env = "shadow_hand_push_block"
    description = "to make each hand push the block in front of it forward to the block's goal position"
    human = REWARDS / "shadow_hand_push_block.py"
    score_unit = "1 for both blocks, 0.5 if the left comes first"
    episode_length = 125
    ends = (
        "An episode ends early when the distances of a hand's five fingertips from its block add up to 1.2 m. The left "
        "block's arrival sets the score: the right block must be at its goal by then, and counts for nothing alone."
    )
    num_observations = 428
    observed = ("block_right_handle_pos", "block_left_handle_pos", "left_goal_pos", "right_goal_pos")
    handles = ("block_right_handle_pos", "block_left_handle_pos")
    reach = 1.2
    scene = Scene(
        right=PALM_DOWN_RIGHT,
        left=PALM_DOWN_LEFT,
        table=Table(size=(1, 1, 0.6), friction=0.75),
        things={
            "object": Placed(
                thing=Cube(), pos=(0, 0.2, 0.625), euler=CUBE_START, points={"block_right_handle": (0, 0, 0)}
            ),
            "block_left": Placed(
                thing=Cube(), pos=(0, -0.2, 0.625), euler=CUBE_START, points={"block_left_handle": (0, 0, 0)}
            ),
        },
        goals={
            "right_goal": Pose(pos=(-0.2, 0.2, 0.625), euler=CUBE_START),
            "left_goal": Pose(pos=(-0.2, -0.2, 0.625), euler=CUBE_START),
        },
        marker=Pose(pos=(0, 0.2, 10.6), euler=CUBE_START),
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "right block"),
        *HAND_VARIABLES,
        *point_variables("block_right_handle", "right block"),
        *point_variables("block_left_handle", "left block"),
        *point_variables("left_goal", "where the left block should go"),
        *point_variables("right_goal", "where the right block should go"),
    )

    def observe(self, s: State) -> Tensor:
        return torch.nn.functional.pad(super().observe(s), (0, 5))  # the original leaves the last five at 0

    def success(self, s: State) -> Tensor:
        """0 until the left block arrives; then 1 if the right one is there already, else 0.5 until the episode ends."""
        right = distance(s["block_right_handle_pos"], s["right_goal_pos"]) < ARRIVED
        left = distance(s["block_left_handle_pos"], s["left_goal_pos"]) < ARRIVED
        return torch.where(left, torch.where(right, 1.0, 0.5), 0.0)
