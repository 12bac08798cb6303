"""What the tasks share in which one hand passes an egg to the other."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import torch
from torch import Tensor

from ...tasks.rotations import tumble, wxyz
from ...tasks.task import State
from ...types import StateVar
from .common import TwoHands, distance, towards_goal
from .variables import FINGERTIPS, ROTATION_DISTANCE, goal_variables, thing_variables

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


def strayed(right: Tensor, left: Tensor, homes: Tensor) -> Tensor:
    """(N,) whether the right or the left hand's point (N, 3) is too far from its home, of homes (2, 3) [m]."""
    return (distance(torch.stack((right, left), dim=1), homes) > LEASH).any(dim=-1)
