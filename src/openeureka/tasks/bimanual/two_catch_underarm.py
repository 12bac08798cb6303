"""Each hand throws its egg to the other one, both palms up and free to move, fingers facing each other."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...types import StateVar
from ..task import State
from .catch import CAUGHT, EGG_VARIABLES, Catch
from .common import dexterity_recipe, distance, towards_goal
from .objects import Egg
from .scene import Placed, Pose, Scene
from .variables import goal_variables, thing_variables, two_handed


class ShadowHandTwoCatchUnderarm(Catch):
    env = "shadow_hand_two_catch_underarm"
    description = "to make the two hands, which may move, swap their eggs by throwing both underarm at the same time"
    episode_length = 75
    num_observations = 446
    num_actions = 52
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
        num_observations,
        *EGG_VARIABLES,
        *thing_variables("object_another", "egg that starts at the left hand"),
        *goal_variables("where the left hand's egg should come to rest", "goal_another"),
        StateVar(
            name="rotation_distance_another",
            meaning="angle between the orientations of object_another and goal_another [rad], 0 to pi",
            use="zero_centred",
        ),
    )
    recipe = dexterity_recipe(env_steps=5_000_000)

    def observe(self, s: State) -> Tensor:
        another = (s["object_another_pose"], s["object_another_linvel"], s["object_another_angvel"] * 0.2)
        return torch.cat((super().observe(s), *another, towards_goal(s, "object_another", "goal_another")), dim=-1)

    def terminated(self, s: State) -> Tensor:
        return super().terminated(s) | (s["object_another_pos"][:, 2] <= self.drop_height)

    def success(self, s: State) -> Tensor:
        first, second = self._distances(s)
        return first + second < 2 * CAUGHT

    def human_reward(self, s: State) -> Tensor:
        first, second = self._distances(s)
        return self.closeness(first, s["rotation_distance"]) + self.closeness(second, s["rotation_distance_another"])

    def _distances(self, s: State) -> tuple[Tensor, Tensor]:
        return (
            distance(s["object_pos"], s["goal_pos"]),
            distance(s["object_another_pos"], s["goal_another_pos"]),
        )
