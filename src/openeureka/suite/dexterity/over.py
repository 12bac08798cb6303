"""The right hand throws an egg to the left one, both palms up, fingers facing each other."""

from __future__ import annotations

import math

from ..assets import REWARDS
from .catch import EGG_VARIABLES, Catch
from .objects import Egg
from .scene import Placed, Pose, Scene
from .variables import two_handed


class ShadowHandOver(Catch):
    env = "shadow_hand_over"
    description = "to make the right hand throw the egg that it holds so that it lands and stays on the left palm"
    human = REWARDS / "catch.py"
    episode_length = 75
    ends = "An episode ends early when the egg falls to a height of 0.2 m."
    num_observations = 398
    num_actions = 40
    scene = Scene(
        right=Pose(pos=(0, 0, 0.5)),
        left=Pose(pos=(0, -1, 0.5), euler=(0, 0, math.pi)),
        hands_move=False,
        things={"object": Placed(thing=Egg(), pos=(0, -0.39, 0.555))},  # 0.54 in the original, inside the palm at times
        goals={"goal": Pose(pos=(0, -0.64, 0.54))},
    )
    joint_noise = 0.2
    position_noise = 0.01
    drop_height = 0.2
    spec = two_handed(scene, num_observations, *EGG_VARIABLES)
