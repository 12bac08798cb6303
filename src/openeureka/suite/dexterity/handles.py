"""What the tasks share in which each hand has its own point to reach."""

from __future__ import annotations

import math
from typing import ClassVar

import torch
from torch import Tensor

from ...tasks.task import State, View
from .common import TwoHands, finger_distances
from .scene import Pose
from .variables import FINGERTIPS, LEFT_FINGERS, PALMS, RIGHT_FINGERS

PALM_DOWN_RIGHT = Pose(pos=(0.55, 0.2, 0.8), euler=(math.pi, 0, math.pi / 2))
PALM_DOWN_LEFT = Pose(pos=(0.55, -0.2, 0.8), euler=(math.pi, 0, math.pi / 2))
"""Side by side above a table, fingers along -x."""

HAND_VARIABLES = (*FINGERTIPS, *PALMS, *RIGHT_FINGERS, *LEFT_FINGERS)


class Handles(TwoHands):
    """A handle for each hand; an episode ends when a hand strays from its own."""

    view = View(azimuth=35.0, elevation=-35.0)
    transition_scale = 0.5
    orientation_scale = 0.1
    handles: ClassVar[tuple[str, str]]
    """State variables with the points for the right and for the left hand."""
    reach: ClassVar[float] = math.inf
    """Summed distance of a hand's fingers from its handle that ends the episode [m]."""

    def terminated(self, s: State) -> Tensor:
        return torch.maximum(*self.reaches(s)) >= self.reach

    def reaches(self, s: State) -> tuple[Tensor, Tensor]:
        """Summed distances (N,) of the fingers from the handle, of the right and of the left hand [m]."""
        right, left = self.handles
        return finger_distances(s, "right", s[right]), finger_distances(s, "left", s[left])
