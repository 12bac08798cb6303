"""The right hand takes a bucket and the left hand a cube, and they bring the cube to the bucket."""

from __future__ import annotations

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .common import distance
from .handles import HAND_VARIABLES, PALM_DOWN_LEFT, PALM_DOWN_RIGHT, Handles
from .objects import CUBE_START, Bucket, Cube
from .scene import Placed, Pose, Scene, Table
from .variables import point_variables, thing_variables, two_handed

PLACED = 0.2  # [m] between the middles of bucket and cube, as the original has it: also reached beside the bucket


class ShadowHandGraspAndPlace(Handles):
    env = "shadow_hand_grasp_and_place"
    description = "to make the left hand pick up the block and put it into the bucket that the right hand holds"
    human = REWARDS / "shadow_hand_grasp_and_place.py"
    episode_length = 500
    ends = (
        "An episode ends early when the distances of a hand's five fingertips from its bucket (right) or "
        "block (left) add up to 1.5 m."
    )
    num_observations = 425
    observed = ("block_right_handle_pos", "block_right_handle_rot", "block_left_handle_pos", "block_left_handle_rot")
    handles = ("block_right_handle_pos", "block_left_handle_pos")
    reach = 1.5
    scene = Scene(
        right=PALM_DOWN_RIGHT,
        left=PALM_DOWN_LEFT,
        table=Table(size=(1, 1, 0.6)),
        things={
            "object": Placed(thing=Bucket(), pos=(0, 0.2, 0.653), link_points={"block_right_handle": (0, 0, 0)}),
            "block": Placed(
                thing=Cube(), pos=(0, -0.2, 0.625), euler=CUBE_START, points={"block_left_handle": (0, 0, 0)}
            ),
        },
        goals={"goal": Pose(pos=(-0.3, 0, 0.6))},
        marker=Pose(pos=(0, 0.2, 10.6)),
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "bucket"),
        *point_variables("goal", "unused, a fixed point of the table", use="raw"),
        *HAND_VARIABLES,
        *point_variables("block_right_handle", "middle of the bucket, which is 10 cm high, its mouth 11 cm wide"),
        *point_variables("block_left_handle", "middle of the block, a cube of 5 cm"),
    )

    def success(self, s: State) -> Tensor:
        return distance(s["block_right_handle_pos"], s["block_left_handle_pos"]) < PLACED
