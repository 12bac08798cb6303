"""The right hand passes an egg to the left one beside it, palms up and tilted towards each other."""

from __future__ import annotations

import torch
from torch import Tensor

from ...tasks.rotations import rotate
from ...tasks.task import State, View
from ..assets import REWARDS
from .catch import EGG_VARIABLES, Catch, strayed
from .objects import Egg
from .scene import PALM_POINT, Placed, Pose, Scene
from .variables import PALMS, two_handed


class ShadowHandCatchAbreast(Catch):
    env = "shadow_hand_catch_abreast"
    description = (
        "to make the right hand throw the egg from its palm sideways so that the left hand next to it catches it"
    )
    human = REWARDS / "catch.py"
    episode_length = 150
    ends = "An episode ends early when the egg falls to a height of 0.2 m, or a wrist moves by more than 0.1 m."
    num_observations = 422
    view = View(azimuth=20.0, elevation=-35.0)
    transition_scale = 0.5
    orientation_scale = 1.0
    scene = Scene(
        right=Pose(pos=(0, -0.55, 0.5), euler=(0, 0.3925, -1.57)),
        left=Pose(pos=(0, -1.15, 0.5), euler=(0, -0.3925, -1.57)),
        things={"object": Placed(thing=Egg(), pos=(-0.39, -0.55, 0.545))},  # 0.54 in the original, inside the palm
        goals={"goal": Pose(pos=(-0.39, -1.15, 0.54))},
    )
    drop_height = 0.2
    spec = two_handed(scene, num_observations, *EGG_VARIABLES, *PALMS)

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.homes = torch.tensor([[-0.3, -0.55, 0.5], [-0.3, -1.15, 0.5]], device=self.device)
        self.palm_point = torch.tensor(PALM_POINT, device=self.device)

    def terminated(self, s: State) -> Tensor:
        right, left = (
            s[f"{side}_hand_pos"] - rotate(s[f"{side}_hand_rot"], self.palm_point) for side in ("right", "left")
        )
        return super().terminated(s) | strayed(right, left, self.homes)
