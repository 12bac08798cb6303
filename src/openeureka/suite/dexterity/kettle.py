"""The right hand takes a kettle and the left hand a bucket, to bring the spout to the bucket."""

from __future__ import annotations

import math

from torch import Tensor

from ...tasks.task import State
from ..assets import REWARDS
from .common import distance
from .handles import HAND_VARIABLES, Handles
from .objects import Bucket, Kettle
from .scene import Placed, Pose, Scene, Table
from .variables import goal_variables, point_variables, thing_variables, two_handed

POURING = 0.05  # [m] between spout and bucket
DROPPED = 0.2  # [m] height of the bucket's point; 0.353 on the table


class ShadowHandKettle(Handles):
    """There is no water here: in the original, nothing measures it."""

    env = "shadow_hand_kettle"
    description = "to make the right hand pour water from the kettle into the bucket that the left hand holds"
    human = REWARDS / "shadow_hand_kettle.py"
    episode_length = 125
    ends = "An episode ends early when the point below the bucket, bucket_handle_pos, falls to a height of 0.2 m."
    num_observations = 417
    observed = ("kettle_handle_pos", "bucket_handle_pos")
    handles = ("kettle_handle_pos", "bucket_handle_pos")
    scene = Scene(
        right=Pose(pos=(0.55, 0.2, 0.6), euler=(math.pi, 1.57, 1.57)),
        left=Pose(pos=(0.55, -0.2, 0.6), euler=(math.pi, -1.57, 1.57)),
        table=Table(size=(0.5, 1, 0.4)),
        things={
            "object": Placed(
                thing=Kettle(),
                pos=(0, 0, 0.474),
                euler=(0, 0, math.pi / 2),
                points={"kettle_handle": (0.15, 0, 0), "kettle_spout": (-0.2, 0, 0.07)},
            ),
            "bucket": Placed(thing=Bucket(), pos=(0, -0.3, 0.453), points={"bucket_handle": (0, 0, -0.1)}),
        },
        goals={"goal": Pose(pos=(0, 0, 10.5), euler=(0, 0, math.pi / 2))},
    )
    spec = two_handed(
        scene,
        num_observations,
        *thing_variables("object", "kettle"),
        *thing_variables("bucket", "bucket"),
        *goal_variables("unused, far above the kettle", use="raw"),
        *HAND_VARIABLES,
        *point_variables("kettle_handle", "handle of the kettle"),
        *point_variables("kettle_spout", "end of the kettle's spout"),
        *point_variables(
            "bucket_handle",
            "where the spout should come: 10 cm below the bucket's middle, inside the table at the start (the bucket "
            "is 10 cm high, its mouth 11 cm wide)",
        ),
    )

    def terminated(self, s: State) -> Tensor:
        return s["bucket_handle_pos"][:, 2] <= DROPPED

    def success(self, s: State) -> Tensor:
        return self._apart(s) < POURING

    def _apart(self, s: State) -> Tensor:
        """(N,) [m] between bucket and spout."""
        return distance(s["bucket_handle_pos"], s["kettle_spout_pos"])
