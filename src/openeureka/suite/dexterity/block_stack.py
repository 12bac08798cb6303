"""The hands bring two cubes together in the middle of a table and stack the left one on the right one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import torch
from torch import Tensor

from ...tasks.task import State, View
from ...types import StateVar
from ..assets import REWARDS
from .common import distance
from .handles import HAND_VARIABLES, Handles
from .objects import CUBE_START, Cube
from .scene import SIDES, Placed, Pose, Scene, Table
from .variables import goal_variables, point_variables, thing_variables, two_handed

TOP = 0.675  # [m] height of the upper cube's middle
CLOSE = 0.07  # [m] between a cube and its place in the stack
LEVEL = 0.03  # [m] of the upper cube's height


class ShadowHandBlockStack(Handles):
    env = "shadow_hand_block_stack"
    description = "to make the two hands stack the left block on the right block in the middle of the table"
    human = REWARDS / "shadow_hand_block_stack.py"
    episode_length = 250
    ends = "An episode ends early when the distances of a hand's five fingertips from its block add up to 0.75 m."
    num_observations = 428
    view = View(azimuth=160.0, elevation=-30.0)
    transition_scale = 0.2
    orientation_scale = 0.02
    handles = ("block_right_handle_pos", "block_left_handle_pos")
    reach = 0.75
    scene = Scene(
        right=Pose(pos=(0, 0.6, 0.7), euler=(math.pi, 0, math.pi)),
        left=Pose(pos=(0, -0.6, 0.7), euler=(math.pi, 0, 0)),
        hands_touch=True,
        table=Table(size=(0.5, 1, 0.6), friction=0.225),
        things={
            "object": Placed(
                thing=Cube(friction=0.375),
                pos=(0, 0.1, 0.625),
                euler=CUBE_START,
                points={"block_right_handle": (0, 0, 0)},
            ),
            "block": Placed(
                thing=Cube(friction=0.375),
                pos=(0, -0.1, 0.625),
                euler=CUBE_START,
                points={"block_left_handle": (0, 0, 0)},
            ),
        },
        goals={"goal": Pose(pos=(0, 0.1, 0.625), euler=CUBE_START)},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "right block"),
        *goal_variables("+0.1 m in y from where the lower, right block belongs", use="raw"),
        *(
            StateVar(
                f"{side}_goal_pos", f"where the {side} block belongs: position [m], world frame", (3,), use="point"
            )
            for side in SIDES
        ),
        *HAND_VARIABLES,
        *thing_variables("block", "left block"),
        *point_variables("block_right_handle", "middle of the right block, a cube of 5 cm"),
        *point_variables("block_left_handle", "middle of the left block, a cube of 5 cm"),
    )

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.offsets = torch.tensor([[0.0, -0.1, 0.0], [0.0, -0.1, 0.05]], device=self.device)

    def compute_state(self) -> dict[str, Any]:
        s = super().compute_state()
        right, left = self._places(s["goal_pos"])
        return {**s, "right_goal_pos": right, "left_goal_pos": left}

    def observe(self, s: State) -> Tensor:
        block = s["block_pose"], s["block_linvel"], s["block_angvel"] * 0.2
        seen = torch.cat((super().observe(s), *block), dim=-1)
        return torch.nn.functional.pad(seen, (0, 4))  # the original leaves the last four at 0

    def ghosts(self) -> Mapping[str, Tensor]:
        pose = self.goal_poses[:, 0]
        lower, upper = (torch.cat((place, pose[:, 3:]), dim=-1) for place in self._places(pose[:, :3]))
        return {"object": lower, "block": upper}

    def success(self, s: State) -> Tensor:
        return self._in_place(s) & (self._height_error(s) < LEVEL)

    def _places(self, goal: Tensor) -> Iterator[Tensor]:
        """Of the right and of the left cube (N, 3) [m]."""
        return (goal + offset for offset in self.offsets)

    def _errors(self, s: State) -> tuple[Tensor, Tensor]:
        """Distances (N,) of the right and of the left cube from the lower and the upper place [m]."""
        lower, upper = self._places(s["goal_pos"])
        return distance(s["block_right_handle_pos"], lower), distance(s["block_left_handle_pos"], upper)

    def _in_place(self, s: State) -> Tensor:
        return torch.maximum(*self._errors(s)) < CLOSE

    def _height_error(self, s: State) -> Tensor:
        return (TOP - s["block_left_handle_pos"][:, 2]).abs()
