"""One hand passes an egg to the other: four tasks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import torch
from torch import Tensor

from ...tasks.rotations import rotate, tumble, wxyz
from ...tasks.task import State, View
from ...types import StateVar
from ..assets import REWARDS
from .common import TwoHands, distance, towards_goal
from .objects import Egg
from .scene import PALM_POINT, Placed, Pose, Scene
from .variables import FINGERTIPS, PALMS, ROTATION_DISTANCE, goal_variables, thing_variables, two_handed

CAUGHT = 0.03  # [m] between egg and goal
LEASH = 0.1  # [m] that hands may stray in the tasks that keep them in place


def in_any_turn(*variables: StateVar) -> tuple[StateVar, ...]:
    """The variables of things whose goals are places alone: each says so where it has a goal's orientation."""
    told = ("goal_pose", "goal_rot", "goal_another_pose", "goal_another_rot")
    remark = "; the goal's orientation is random and does not matter"
    return tuple(
        replace(v, meaning=v.meaning + remark, use="raw") if v.name in told or "rotation_distance" in v.name else v
        for v in variables
    )


EGG_VARIABLES = in_any_turn(
    *thing_variables("object", "egg"),
    *goal_variables("where the egg should come to rest"),
    *FINGERTIPS,
    ROTATION_DISTANCE,
)


class Catch(TwoHands):
    """Eggs start at one hand, in any orientation. Their goal is a point over the other hand."""

    observed_point = "base"
    memory = (*TwoHands.memory, "goal_poses")
    position_noise: ClassVar[float] = 0.0
    """Noise of the egg's start position, per axis [m]."""
    drop_height: ClassVar[float]
    """Height of the egg that ends the episode [m]."""

    def observe(self, s: State) -> Tensor:
        return torch.cat((super().observe(s), towards_goal(s)), dim=-1)

    def terminated(self, s: State) -> Tensor:
        return s["object_pos"][:, 2] <= self.drop_height

    def reset(self, worlds: Tensor) -> None:
        """Eggs share a draw, and so do goals."""
        super().reset(worlds)
        shift = self.noise.uniform(worlds, 3, -self.position_noise, self.position_noise)
        egg_rot, goal_rot = (tumble(self.noise.uniform(worlds, 2, -1.0, 1.0)) for _ in range(2))
        for egg in self.scene.things:
            columns = self.thing_columns(egg)
            self.qpos[worlds, columns] = torch.cat((self.start[columns][:3] + shift, wxyz(egg_rot)), dim=-1)
        self.goal_poses[worlds, :, 3:] = goal_rot[:, None]

    def success(self, s: State) -> Tensor:
        return distance(s["object_pos"], s["goal_pos"]) < CAUGHT


def _strayed(right: Tensor, left: Tensor, homes: Tensor) -> Tensor:
    """(N,) whether the right or the left hand's point (N, 3) is too far from its home, of homes (2, 3) [m]."""
    return (distance(torch.stack((right, left), dim=1), homes) > LEASH).any(dim=-1)


class ShadowHandOver(Catch):
    """The right hand throws an egg to the left one, both palms up, fingers facing each other."""

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


class ShadowHandCatchUnderarm(Catch):
    """The right hand throws an egg to the left one, both palms up and free to move, fingers facing each other."""

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


class ShadowHandCatchOver2Underarm(Catch):
    """The upright right hand throws the egg over its fingers down to the left palm."""

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
        return super().terminated(s) | _strayed(s["right_base_pos"], s["left_base_pos"], self.homes)


class ShadowHandCatchAbreast(Catch):
    """The right hand passes an egg to the left one beside it, palms up and tilted towards each other."""

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
        return super().terminated(s) | _strayed(right, left, self.homes)
