"""A double door, one leaf for each hand, to be opened or closed: four tasks."""

from __future__ import annotations

import math
from typing import ClassVar

from torch import Tensor

from ...tasks.task import State, View
from ..assets import REWARDS
from .handles import HAND_VARIABLES, PartedHandles, handles_apart
from .objects import DoubleDoor
from .scene import Placed, Pose, Scene
from .variables import goal_variables, point_variables, thing_variables, two_handed

GAP = 0.5  # [m] between the handles, above which the doors count as open
SIDEWAYS = 1.57  # [rad], as the original has it

DOOR_VARIABLES = (
    *thing_variables("object", "frame of the doors, which is fixed at (0, 0, 0.7)", fixed=True),
    *goal_variables("unused, far above the doors", use="raw"),
    *HAND_VARIABLES,
    *point_variables("door_right_handle", "handle of the right door"),
    *point_variables("door_left_handle", "handle of the left door"),
    handles_apart("distance between the handles along y [m], 0.07 when both doors are closed"),
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


class Doors(PartedHandles):
    """Each hand opens or closes one leaf of a double door."""

    episode_length = 250
    ends = "An episode ends early when the distances of a hand's five fingertips from its door handle add up to 1.5 m."
    num_observations = 417
    observed = ("door_left_handle_pos", "door_right_handle_pos")
    orientation_scale = 0.5
    view = View(azimuth=150.0, elevation=-20.0)
    handles = ("door_right_handle_pos", "door_left_handle_pos")
    reach = 1.5
    opens: ClassVar[bool]
    """Whether the doors are to be opened; otherwise closed."""
    offset: ClassVar[float] = 2.0
    """Offset in the human reward for closing."""

    def success(self, s: State) -> Tensor:
        gap = self.handle_gap(s)
        return gap > GAP if self.opens else gap < GAP

    def handle_gap(self, s: State) -> Tensor:
        """(N,) [m] along y between the handles."""
        return (s["door_right_handle_pos"] - s["door_left_handle_pos"])[:, 1].abs()


class ShadowHandDoorOpenInward(Doors):
    """Each hand pulls its leaf of a closed double door open, towards itself."""

    env = "shadow_hand_door_open_inward"
    description = "to make the two hands open the closed double door by pulling its handles towards them"
    human = REWARDS / "door_open.py"
    opens = True
    scene = door_scene(towards_hands=True)
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)


class ShadowHandDoorOpenOutward(Doors):
    """Each hand pushes its leaf of a closed double door open, away from itself."""

    env = "shadow_hand_door_open_outward"
    description = "to make the two hands open the closed double door by pushing its handles away from them"
    human = REWARDS / "door_open.py"
    opens = True
    scene = door_scene(towards_hands=False, goal_z=5.7)
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)


class ShadowHandDoorCloseInward(Doors):
    """Each hand pushes its leaf of a double door shut that stands open towards the hands."""

    env = "shadow_hand_door_close_inward"
    description = "to make the two hands close the double door, open towards them, by pushing its handles away"
    human = REWARDS / "door_close.py"
    opens = False
    scene = door_scene(towards_hands=True, angle=SIDEWAYS, hand_x=0.9, hand_y=0.5)
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)


class ShadowHandDoorCloseOutward(Doors):
    """Each hand reaches through a double door that stands open away from it, and pulls its leaf shut."""

    env = "shadow_hand_door_close_outward"
    description = "to make the two hands close the double door, open away from them, by pulling its handles"
    human = REWARDS / "door_close.py"
    opens = False
    offset = 6.0
    scene = door_scene(towards_hands=False, angle=SIDEWAYS)
    reach = 3.0  # the hands start far from the handles
    ends = "An episode ends early when the distances of a hand's five fingertips from its door handle add up to 3 m."
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)
