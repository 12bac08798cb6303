"""What the four door tasks share: two leaves, one for each hand."""

from __future__ import annotations

import math

from torch import Tensor

from ...tasks.task import State, View
from .handles import HAND_VARIABLES, Handles
from .objects import DoubleDoor
from .scene import Placed, Pose, Scene
from .variables import goal_variables, point_variables, thing_variables

GAP = 0.5  # [m] between the handles, above which the doors count as open
SIDEWAYS = 1.57  # [rad], as the original has it

DOOR_VARIABLES = (
    *thing_variables("object", "frame of the doors, which is fixed"),
    *goal_variables("unused, far above the doors", use="raw"),
    *HAND_VARIABLES,
    *point_variables("door_right_handle", "handle of the right door"),
    *point_variables("door_left_handle", "handle of the left door"),
)


def door_scene(
    *, towards_hands: bool, angle: float = 0.0, hand_x: float = 0.55, hand_y: float = 0.2, goal_z: float = 10.7
) -> Scene:
    """Doors across the x axis and hands at its positive side, thumbs pointing up (right) and down (left).

    Args:
        towards_hands: which way the doors open; for this the original turns them upside down.
        angle: of both doors, at the start and where their springs rest [rad].
        hand_x: distance between hands and doors [m].
        hand_y: of each hand from the middle [m].
        goal_z: height of the goal, which plays no part [m].
    """
    turn = (0, math.pi if towards_hands else 0, 0)
    door = DoubleDoor(hands_at=-1 if towards_hands else 1, spring_angle=angle)
    return Scene(
        right=Pose(pos=(hand_x, hand_y, 0.6), euler=(math.pi, SIDEWAYS, SIDEWAYS)),
        left=Pose(pos=(hand_x, -hand_y, 0.6), euler=(math.pi, -SIDEWAYS, SIDEWAYS)),
        hands_touch=True,
        things={"object": Placed(thing=door, pos=(0, 0, 0.7), euler=turn, fixed=True)},
        goals={"goal": Pose(pos=(0, 0, goal_z), euler=turn)},
        angles={"door_right_hinge": angle, "door_left_hinge": angle},
    )


class Doors(Handles):
    """Each hand opens or closes one leaf of a double door."""

    episode_length = 250
    ends = "An episode ends early when the distances of a hand's five fingertips from its door handle add up to 1.5 m."
    num_observations = 417
    observed = ("door_left_handle_pos", "door_right_handle_pos")
    orientation_scale = 0.5
    view = View(azimuth=150.0, elevation=-20.0)
    handles = ("door_right_handle_pos", "door_left_handle_pos")
    reach = 1.5

    def handle_gap(self, s: State) -> Tensor:
        """(N,) [m] along y between the handles."""
        return (s["door_right_handle_pos"] - s["door_left_handle_pos"])[:, 1].abs()
