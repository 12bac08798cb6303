"""The right hand throws an egg to the left one, both palms up and free to move, fingers facing each other."""

from __future__ import annotations

import math

from ..assets import REWARDS
from .catch import EGG_VARIABLES, Catch
from .objects import Egg
from .scene import Placed, Pose, Scene
from .variables import two_handed


class ShadowHandCatchUnderarm(Catch):
    env = "shadow_hand_catch_underarm"
    description = "to make the right hand throw the egg underarm so that the left hand, which may move too, catches it"
    human = REWARDS / "catch.py"
    episode_length = 75
    ends = "An episode ends early when the egg falls to a height of 0.1 m."
    num_observations = 422
    transition_scale = 0.05
    orientation_scale = 0.5
    scene = Scene(
        right=Pose(pos=(0, 0, 0.5)),
        left=Pose(pos=(0, -1.15, 0.5), euler=(0, 0, math.pi)),
        things={"object": Placed(thing=Egg(), pos=(0, -0.39, 0.555))},  # 0.54 in the original, inside the palm at times
        goals={"goal": Pose(pos=(0, -0.79, 0.54))},
    )
    joint_noise = 0.2
    position_noise = 0.01
    drop_height = 0.1
    spec = two_handed(scene, num_observations, *EGG_VARIABLES)
