"""Each hand pushes its leaf of a double door shut that stands open towards the hands."""

from __future__ import annotations

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .door import DOOR_VARIABLES, GAP, SIDEWAYS, Doors, door_scene
from .variables import two_handed


class ShadowHandDoorCloseInward(Doors):
    env = "shadow_hand_door_close_inward"
    description = "to make the two hands close the double door, open towards them, by pushing its handles away"
    human = REWARDS / "shadow_hand_door_close_inward.py"
    scene = door_scene(towards_hands=True, angle=SIDEWAYS, hand_x=0.9, hand_y=0.5)
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)

    def success(self, s: State) -> Tensor:
        return self.handle_gap(s) < GAP
