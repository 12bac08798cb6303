"""Each hand reaches through a double door that stands open away from it, and pulls its leaf shut."""

from __future__ import annotations

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .door import DOOR_VARIABLES, GAP, SIDEWAYS, Doors, door_scene
from .variables import two_handed


class ShadowHandDoorCloseOutward(Doors):
    env = "shadow_hand_door_close_outward"
    description = "to make the two hands close the double door, open away from them, by pulling its handles"
    human = REWARDS / "shadow_hand_door_close_outward.py"
    scene = door_scene(towards_hands=False, angle=SIDEWAYS)
    reach = 3.0  # the hands start far from the handles
    ends = "An episode ends early when the distances of a hand's five fingertips from its door handle add up to 3 m."
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)

    def success(self, s: State) -> Tensor:
        return self.handle_gap(s) < GAP
