"""Each hand turns a cube on its palm to one common orientation after the other."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...tasks.rotations import tumble
from ...tasks.task import Score, State, mean_over_episodes
from ..assets import REWARDS
from .objects import Cube
from .pair import Pair, pair_variables
from .scene import Placed, Pose, Scene
from .variables import two_handed

TOLERANCE = 0.1  # [rad] between a cube and its goal


class ShadowHandReOrientation(Pair):
    """F counts the goals reached in an episode; once either cube has reached its goal, both get new ones."""

    env = "shadow_hand_re_orientation"
    description = "to make each of the two hands turn the cube on its palm to its target orientation"
    human = REWARDS / "shadow_hand_re_orientation.py"
    score_unit, score_range = "goals reached in an episode", (0.0, None)
    ends = (
        "An episode ends early when a cube falls to a height of 0.2 m. The cubes share one goal orientation, which "
        "changes for both as soon as either reaches it."
    )
    episode_length = 600
    num_observations = 422
    num_actions = 40
    scene = Scene(
        right=Pose(pos=(0, 0, 0.5)),
        left=Pose(pos=(0, -1.15, 0.5), euler=(0, 0, math.pi)),
        hands_move=False,
        things={
            "object": Placed(thing=Cube(), pos=(0, -0.39, 0.60)),
            "object_another": Placed(thing=Cube(), pos=(0, -0.76, 0.60)),
        },
        goals={"goal": Pose(pos=(0, -0.39, 0.56)), "goal_another": Pose(pos=(0, -0.76, 0.56))},
    )
    memory = (*Pair.memory, "reached")
    joint_noise = 0.2
    position_noise = 0.01
    drop_height = 0.2
    spec = two_handed(scene, num_observations, *pair_variables("cube", "pose to hold"))

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.reached = torch.zeros(self.num_envs, dtype=torch.bool, device=self.device)
        self.everywhere = torch.arange(self.num_envs, device=self.device)

    def apply_action(self, actions: Tensor) -> None:
        self.change_goals()
        super().apply_action(actions)

    def change_goals(self) -> None:
        """Draw a new orientation where the last step reached a goal."""
        # Drawn for all worlds, used where a goal was reached: asking which worlds these are would stall a GPU.
        fresh = tumble(self.noise.uniform(self.everywhere, 2, -1.0, 1.0))
        turns = self.goal_poses[..., 3:]
        turns[:] = torch.where(self.reached[:, None, None], fresh[:, None], turns)

    def reset(self, worlds: Tensor) -> None:
        super().reset(worlds)
        self.reached = self.reached.index_fill(0, worlds, False)

    def success(self, s: State) -> Tensor:
        return torch.minimum(s["rotation_distance"], s["rotation_distance_another"]) < TOLERANCE

    def outcome(self, s: State) -> Tensor:
        """1 where this step reached a goal; F is their count."""
        self.reached = self.success(s)
        reached = self.reached.to(torch.float32)
        self.successes = self.successes + reached
        return reached

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_episodes(self.successes, ended)
