"""Each hand throws its egg to the other one, both palms up and free to move, fingers facing each other."""

from __future__ import annotations

import math

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .catch import CAUGHT, in_any_turn
from .objects import Egg
from .pair import Pair, pair_variables
from .scene import Placed, Pose, Scene
from .variables import two_handed


class ShadowHandTwoCatchUnderarm(Pair):
    env = "shadow_hand_two_catch_underarm"
    description = "to make the two hands, which may move, swap their eggs by throwing both underarm at the same time"
    human = REWARDS / "shadow_hand_two_catch_underarm.py"
    episode_length = 75
    ends = "An episode ends early when an egg falls to a height of 0.2 m."
    num_observations = 446
    transition_scale = 0.05
    orientation_scale = 0.5
    scene = Scene(
        right=Pose(pos=(0, 0, 0.5)),
        left=Pose(pos=(0, -1.15, 0.5), euler=(0, 0, math.pi)),
        things={  # both at 0.54 in the original, inside the palms at times
            "object": Placed(thing=Egg(), pos=(0, -0.39, 0.555)),
            "object_another": Placed(thing=Egg(), pos=(0, -0.78, 0.555)),
        },
        goals={"goal": Pose(pos=(0, -0.79, 0.54)), "goal_another": Pose(pos=(0, -0.38, 0.54))},
    )
    joint_noise = 0.2
    position_noise = 0.01
    drop_height = 0.2
    spec = two_handed(
        scene, num_observations, *in_any_turn(*pair_variables("egg", "where it should come to rest, goal"))
    )

    def success(self, s: State) -> Tensor:
        first, second = self.distances(s)
        return first + second < 2 * CAUGHT
