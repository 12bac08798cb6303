"""The upright right hand throws the egg over its fingers down to the left palm."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .catch import EGG_VARIABLES, Catch, strayed
from .objects import Egg
from .scene import Placed, Pose, Scene
from .variables import two_handed


class ShadowHandCatchOver2Underarm(Catch):
    env = "shadow_hand_catch_over2underarm"
    description = (
        "to make the right hand, which points upwards, throw the egg at its fingertips down to the left hand, "
        "which catches it on its upturned palm"
    )
    human = REWARDS / "shadow_hand_catch_over2underarm.py"
    episode_length = 75
    ends = (
        "An episode ends early when the egg falls to a height of 0.3 m, or a forearm's lower end moves by "
        "more than 0.1 m."
    )
    num_observations = 422
    transition_scale = 0.1
    orientation_scale = 2.0
    scene = Scene(
        right=Pose(pos=(0, 0, 0.5), euler=(1.67, 3.14, 0)),
        left=Pose(pos=(0, -0.8, 0.5), euler=(0, 0, math.pi)),
        things={"object": Placed(thing=Egg(), pos=(0, 0.05, 1.03))},  # 1.0 in the original, inside the fingertips
        goals={"goal": Pose(pos=(0, -0.4, 0.55))},
    )
    drop_height = 0.3
    spec = two_handed(scene, num_observations, *EGG_VARIABLES)

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.homes = torch.tensor([self.scene.right.pos, self.scene.left.pos], device=self.device)

    def terminated(self, s: State) -> Tensor:
        return super().terminated(s) | strayed(s["right_base_pos"], s["left_base_pos"], self.homes)
