"""ShadowHand: 24 joints turn a 5 cm cube in the palm."""

from __future__ import annotations

from typing import Any

import mujoco
import torch
from torch import Tensor

from ...tasks.sensors import add_wrench_sensors, body_states, contact_wrenches
from ...tasks.task import State
from ...types import StateSpec, StateVar
from ..assets import REWARDS
from ..shadow import FINGERTIPS, add_shadow_hand
from .reorientation import Reorientation, add_cube, hand_variables, reorientation_recipe

PREFIX = "hand_"
TIPS = tuple(PREFIX + name for name in FINGERTIPS)
BODIES = 28  # 26 of the hand, the object, the picture of the goal


def shadow_hand_variables(held: str, place: str = "in the palm") -> tuple[StateVar, ...]:
    """The state variables of a Shadow Hand that holds a thing; `place` is where the thing should stay."""
    return (
        *hand_variables(
            joints="wrist 1 0; first, middle and ring finger 3 2 1 0; little finger 4 3 2 1 0; thumb 4 3 2 1 0",
            dofs=24,
            actions=20,
            observations=211,
            held=held,
            place=place,
        ),
        StateVar(
            "fingertip_state",
            "last links of the first, middle, ring, little finger and thumb: position of the last joint "
            "[m], quaternion x y z w, linear velocity [m/s], angular velocity [rad/s], world frame",
            (5, 13),
        ),
        StateVar("fingertip_pos", "positions in fingertip_state [m]", (5, 3)),
        StateVar("vec_sensor_tensor", "contact force [N] and torque [N m] on each last link, in its frame", (30,)),
        StateVar(
            "rigid_body_states",
            f"every body, in the layout of fingertip_state: 26 of the hand, the {held}, a picture of the goal, "
            "beside goal_pos",
            (BODIES, 13),
        ),
        StateVar(
            "fingertip_handles", "rows of the last links in rigid_body_states, as integers", (5,), kind="constant"
        ),
        StateVar("num_fingertips", "number of fingers, 5", kind="int"),
    )


class ShadowHand(Reorientation):
    env = "shadow_hand"
    description = "to make the shadow hand spin the object to a target orientation"
    human = REWARDS / "cube_in_hand.py"
    control_dt = 0.01667
    substeps = 2
    num_observations = 211
    num_actions = 20
    object_start = (0.0, -0.39, 0.60)
    goal_position = (0.0, -0.39, 0.56)

    spec = StateSpec(shadow_hand_variables("cube"))
    recipe = reorientation_recipe(hidden=(128, 128))

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        add_shadow_hand(spec, PREFIX, pos=[0, 0, 0.5])
        add_cube(spec, side=0.05, density=567, start=ShadowHand.object_start, goal=ShadowHand.goal_position)
        add_wrench_sensors(spec, TIPS)
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.bodies = [self.sim.bind(field) for field in ("xpos", "xquat", "cvel", "subtree_com")]
        self.sensors = self.sim.bind("sensordata")
        model = self.sim.model
        self.roots = torch.from_numpy(model.body_rootid[1:]).to(self.device, torch.int64)
        self.fingertip_handles = torch.tensor([model.body(tip).id - 1 for tip in TIPS], device=self.device)

    def compute_state(self) -> dict[str, Any]:
        position, quaternion, velocity, centre = self.bodies
        bodies = body_states(position[:, 1:], quaternion[:, 1:], velocity[:, 1:], centre[:, self.roots])
        fingertips = bodies[:, self.fingertip_handles]
        return {
            **super().compute_state(),
            "fingertip_state": fingertips,
            "fingertip_pos": fingertips[..., :3].clone(),
            "vec_sensor_tensor": contact_wrenches(self.sensors, len(TIPS)).flatten(1),
            "rigid_body_states": bodies,
            "fingertip_handles": self.fingertip_handles,
            "num_fingertips": len(TIPS),
        }

    def touch(self, s: State) -> tuple[Tensor, ...]:
        return s["fingertip_state"].flatten(1), s["vec_sensor_tensor"] * s["force_torque_obs_scale"]
