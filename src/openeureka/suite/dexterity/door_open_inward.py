"""Each hand pulls its leaf of a closed double door open, towards itself."""

from __future__ import annotations

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .door import DOOR_VARIABLES, GAP, Doors, door_scene
from .variables import two_handed


class ShadowHandDoorOpenInward(Doors):
    env = "shadow_hand_door_open_inward"
    description = "to make the two hands open the closed double door by pulling its handles towards them"
    human = REWARDS / "door_open.py"
    scene = door_scene(towards_hands=True)
    spec = two_handed(scene, Doors.num_observations, *DOOR_VARIABLES)

    def success(self, s: State) -> Tensor:
        return self.handle_gap(s) > GAP
