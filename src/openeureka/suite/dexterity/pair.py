"""What the tasks share in which each hand has its own thing, and each thing its own goal."""

from __future__ import annotations

import torch
from torch import Tensor

from ...tasks.task import State
from ...types import StateVar
from .catch import Catch
from .common import distance, towards_goal
from .variables import FINGERTIPS, ROTATION_DISTANCE, goal_variables, thing_variables


def pair_variables(thing: str, goal: str) -> tuple[StateVar, ...]:
    """State variables of two things of one kind and of their goals, both named by the arguments."""
    return (
        *thing_variables("object", f"{thing} that starts at the right hand"),
        *goal_variables(f"{goal} of object"),
        *FINGERTIPS,
        ROTATION_DISTANCE,
        *thing_variables("object_another", f"{thing} that starts at the left hand"),
        *goal_variables(f"{goal} of object_another", "goal_another"),
        StateVar(
            "rotation_distance_another",
            "angle between the orientations of object_another and goal_another [rad], 0 to pi",
            use="zero_centred",
        ),
    )


class Pair(Catch):
    """`object` and `object_another`, with the goals `goal` and `goal_another`."""

    def observe(self, s: State) -> Tensor:
        another = (s["object_another_pose"], s["object_another_linvel"], s["object_another_angvel"] * 0.2)
        return torch.cat((super().observe(s), *another, towards_goal(s, "object_another", "goal_another")), dim=-1)

    def terminated(self, s: State) -> Tensor:
        return super().terminated(s) | (s["object_another_pos"][:, 2] <= self.drop_height)

    def distances(self, s: State) -> tuple[Tensor, Tensor]:
        """Distances (N,) of both things from their goals [m]."""
        return distance(s["object_pos"], s["goal_pos"]), distance(s["object_another_pos"], s["goal_another_pos"])
