"""What the tasks share in which each hand has a thing of its own, and each thing a goal."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from torch import Tensor

from ...types import StateVar
from ..rotations import rotation_distance
from ..task import State
from .catch import Catch
from .common import distance, towards_goal
from .shapes import Vector
from .variables import FINGERTIPS, ROTATION_DISTANCE, goal_variables, thing_variables


def pair_variables(thing: str, goal: str) -> tuple[StateVar, ...]:
    """Of two things of a kind and their goals, in words."""
    return (
        *thing_variables("object", f"{thing} that starts at the right hand"),
        *goal_variables(f"{goal} of object"),
        *FINGERTIPS,
        ROTATION_DISTANCE,
        *thing_variables("object_another", f"{thing} that starts at the left hand"),
        *goal_variables(f"{goal} of object_another", "goal_another"),
        StateVar(
            name="rotation_distance_another",
            meaning="angle between the orientations of object_another and goal_another [rad], 0 to pi",
            use="zero_centred",
        ),
    )


class Pair(Catch):
    """Two things that start in the same orientation, and two goals that have the same orientation."""

    goal_another: ClassVar[Vector]
    """Place of the second goal [m]."""

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.goal_another_place = torch.tensor([self.goal_another], device=self.device)

    def compute_state(self) -> dict[str, Any]:
        state, orientation = super().compute_state(), self.goal_pose[:, 3:]
        goal = torch.cat((self.goal_another_place.expand(self.num_envs, 3), orientation), dim=-1)
        return {
            **state,
            "goal_another_pose": goal,
            "goal_another_pos": goal[:, :3],
            "goal_another_rot": goal[:, 3:],
            "rotation_distance_another": rotation_distance(state["object_another_rot"], orientation),
        }

    def observe(self, s: State) -> Tensor:
        another = (s["object_another_pose"], s["object_another_linvel"], s["object_another_angvel"] * 0.2)
        return torch.cat((super().observe(s), *another, towards_goal(s, "object_another", "goal_another")), dim=-1)

    def terminated(self, s: State) -> Tensor:
        return super().terminated(s) | (s["object_another_pos"][:, 2] <= self.drop_height)

    def reset(self, worlds: Tensor) -> None:
        """The second thing starts like the first, beside it."""
        super().reset(worlds)
        first, second = self.thing_columns("object"), self.thing_columns("object_another")
        start = self.qpos[worlds, first]
        start[:, :3] += self.start[second][:3] - self.start[first][:3]
        self.qpos[worlds, second] = start

    def distances(self, s: State) -> tuple[Tensor, Tensor]:
        """Of both things from their goals (N,) [m]."""
        return (
            distance(s["object_pos"], s["goal_pos"]),
            distance(s["object_another_pos"], s["goal_another_pos"]),
        )
