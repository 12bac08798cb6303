"""The left hand holds a bottle, and the right hand pulls its cap off."""

from __future__ import annotations

import math
from typing import Any

from torch import Tensor

from ...tasks.task import State
from ...types import StateVar
from ..assets import REWARDS
from .common import TwoHands, distance
from .objects import Bottle
from .scene import SIDES, Placed, Pose, Scene, Table
from .variables import FINGERTIPS, PALMS, RIGHT_FINGERS, goal_variables, thing_variables, two_handed

OFF = 0.03  # [m] between bottle and cap; 0.01 when closed
_POSITION = "position [m], world frame"


class ShadowHandBottleCap(TwoHands):
    env = "shadow_hand_bottle_cap"
    description = "to make the left hand hold the bottle and the right hand pull its cap off"
    human = REWARDS / "shadow_hand_bottle_cap.py"
    episode_length = 125
    ends = (
        "An episode ends early when the bottle's mouth falls to a height of 0.5 m, the right palm is 0.5 m "
        "from the mouth, or the left palm 0.2 m from bottle_pos."
    )
    num_observations = 420
    observed = ("bottle_pos", "bottle_cap_pos", "bottle_cap_up")
    transition_scale = 0.1
    orientation_scale = 0.1
    scene = Scene(
        right=Pose(pos=(0, -1.05, 0.5), euler=(0.5, math.pi, math.pi)),
        left=Pose(pos=(0, -0.25, 0.45), euler=(0, 0.87, 0)),
        hands_touch=True,
        table=Table(size=(0.3, 0.3, 0.1), centre=(0, -0.6)),
        things={
            "object": Placed(
                thing=Bottle(),
                pos=(0.0076, -0.6, 0.5065),  # 1 cm off the palm, which the original's (0, -0.6, 0.5) reaches into
                euler=(0, -0.7, 0),
                points={"bottle": (0, 0, 0), "bottle_cap": (0, 0, 0.15)},
            )
        },
        goals={"goal": Pose(pos=(0, -0.6, 1.5), euler=(0, -0.7, 0))},
        angles={
            f"{side}_{joint}": angle
            for side in SIDES
            for joint, angle in (("THJ4", -1.04), ("THJ3", 1.2), ("THJ0", -1.57))
        },
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "bottle"),
        *goal_variables("unused, above the bottle", use="raw"),
        *FINGERTIPS,
        *PALMS,
        *RIGHT_FINGERS,
        StateVar("bottle_pos", f"bottle, 3 cm above its bottom: {_POSITION}", (3,), use="point"),
        StateVar("bottle_cap_pos", f"mouth of the bottle: {_POSITION}", (3,), use="point"),
        StateVar(
            "bottle_cap_up",
            f"point that moves with the cap, near bottle_pos while the bottle is closed: {_POSITION}",
            (3,),
            use="point",
        ),
    )

    def compute_state(self) -> dict[str, Any]:
        return {**super().compute_state(), "bottle_cap_up": self.frames.read()["bottle_cap_up_pos"]}

    def terminated(self, s: State) -> Tensor:
        dropped = s["bottle_cap_pos"][:, 2] <= 0.5
        right_lost = distance(s["bottle_cap_pos"], s["right_hand_pos"]) >= 0.5
        left_lost = distance(s["bottle_pos"], s["left_hand_pos"]) >= 0.2
        return dropped | right_lost | left_lost

    def success(self, s: State) -> Tensor:
        return self._lifted(s) > OFF

    def _lifted(self, s: State) -> Tensor:
        """(N,) [m] how far the cap is from the bottle."""
        return distance(s["bottle_cap_up"], s["bottle_pos"])
