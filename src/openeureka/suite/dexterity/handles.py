"""What the tasks share in which each hand has its own point to reach."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import torch
from torch import Tensor

from ...tasks.task import State, View
from ...types import StateVar
from .common import TwoHands, distance, finger_distances
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


class PartedHandles(Handles):
    """Handles that the hands move apart or together; `handles_apart` says how far."""

    def compute_state(self) -> dict[str, Any]:
        s = super().compute_state()
        return {**s, "handles_apart": self.handle_gap(s)}

    def handle_gap(self, s: State) -> Tensor:
        """(N,) [m] between the handles."""
        right, left = self.handles
        return distance(s[right], s[left])


def handles_apart(meaning: str) -> StateVar:
    """The variable that `PartedHandles` adds."""
    return StateVar("handles_apart", meaning, use="directional")
