"""Ant: four legs of two joints carry a light torso forward."""

from __future__ import annotations

from typing import Any

import mujoco
import torch
from torch import Tensor

from ...tasks.rotations import euler_xyz, rotate_inverse
from ...tasks.sensors import add_wrench_sensors
from ...tasks.task import Recipe, State
from ...types import StateSpec, StateVar
from ..assets import REWARDS
from .legged import Runner, add_floor, running_variables

TORQUE = 15.0  # [N m] at full action
DENSITY = 5.0  # [kg/m3]
# PhysX averages the friction of a pair, robot 1.5 and ground 1.0; MuJoCo takes the larger, so both get the average.
FRICTION = 1.25
# PhysX clamps spin at 64 rad/s, where this cubic damping balances the torque of four legs. Without either, the
# integrator feeds energy to a fast tumble until the robot flies apart, and rewards for mere speed lead there. It is
# 0.1 N m at 8 rad/s, 0.6 % of the weight at 6 m/s.
SPIN_DAMPING = (0.0, 0.0, 2.3e-4)
# Leg: direction of its diagonal in x and y (forward and left), ankle axis, ankle range [deg]. The names are the
# original's; three of them are wrong about where the leg is.
LEGS = {
    "front_left": ((1, 1), (-1, 1, 0), (30, 100)),
    "front_right": ((-1, 1), (1, 1, 0), (-100, -30)),
    "left_back": ((-1, -1), (-1, 1, 0), (-100, -30)),
    "right_back": ((1, -1), (1, 1, 0), (30, 100)),
}


class Ant(Runner):
    env = "ant"
    suite = "isaac"
    description = "to make the ant run forward as fast as possible"
    human = REWARDS / "ant.py"
    episode_length = 1000
    control_dt = 0.0166
    substeps = 2
    num_observations = 60
    num_actions = 8
    feet = tuple(f"{leg}_foot" for leg in LEGS)
    start_height = 0.44
    fall_height = 0.31
    ends = "An episode ends early when the torso is less than 0.31 m above the ground."
    dof_vel_scale = 0.2
    contact_force_scale = 0.1

    spec = StateSpec(
        (
            StateVar("obs_buf", "observation of the policy, before clipping", (60,)),
            *running_variables(
                joints="hip and ankle of the front left, back left, back right and front right leg (not as the source "
                "names the feet)",
                dofs=8,
                feet=4,
                torque="torque / 15 N m",
                standing="about 0.5 when walking",
            ),
            StateVar("up_axis_idx", "index of the vertical axis, 2", kind="int"),
        )
    )
    # The original takes 32.8 M steps with 4096 worlds; fewer worlds and a smaller network learn from fewer steps, and
    # more so when they begin calmly (docs/reference/measurements.md).
    recipe = Recipe(
        hidden=(128, 64),
        env_steps=6_000_000,
        worlds=512,
        horizon=16,
        epochs=4,
        minibatches=2,
        reward_scale=0.01,
        noise=0.4,
        head=0.01,
    )

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        add_floor(spec, FRICTION)
        torso = spec.worldbody.add_body(name="torso", pos=[0, 0, Ant.start_height])
        torso.add_joint(name="root", type=mujoco.mjtJoint.mjJNT_FREE, damping=SPIN_DAMPING)
        # Legs touch the floor only: the original runs without self-collision.
        shape = {"density": DENSITY, "friction": [FRICTION, 0.1, 0.1], "contype": 0, "conaffinity": 1}
        torso.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.25, 0, 0], **shape)
        for i, (name, ((x, y), ankle_axis, ankle_range)) in enumerate(LEGS.items(), start=1):
            capsule = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": [0.08, 0, 0], **shape}
            hinge = {"type": mujoco.mjtJoint.mjJNT_HINGE, "limited": True, "armature": 0.01, "damping": [0.1, 0, 0]}
            to_hip, to_ankle, to_toe = ([0, 0, 0, reach * x, reach * y, 0] for reach in (0.2, 0.2, 0.4))
            torso.add_geom(fromto=to_hip, **capsule)
            leg = torso.add_body(name=f"{name}_leg", pos=to_hip[3:])
            leg.add_joint(name=f"hip_{i}", axis=[0, 0, 1], range=[-40, 40], **hinge)
            leg.add_geom(fromto=to_ankle, **capsule)
            foot = leg.add_body(name=f"{name}_foot", pos=to_ankle[3:])
            foot.add_joint(name=f"ankle_{i}", axis=ankle_axis, range=ankle_range, **hinge)
            foot.add_geom(fromto=to_toe, **capsule)
            for joint in (f"hip_{i}", f"ankle_{i}"):
                motor = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
                motor.gear[0] = TORQUE
        add_wrench_sensors(spec, Ant.feet)
        return spec

    def compute_state(self) -> dict[str, Any]:
        return {**super().compute_state(), "up_axis_idx": 2}

    def observe(self, s: State) -> Tensor:
        torso_quat = s["root_states"][:, 3:7]
        roll, _, yaw = euler_xyz(torso_quat)  # in [0, 2 pi): both jump at the pose the robot should keep
        to_target = s["targets"] - s["root_states"][:, :3]
        angle_to_target = torch.atan2(to_target[:, 2], to_target[:, 0]) - yaw  # z, not y, as in the original
        return torch.cat(
            (
                s["torso_height"][:, None],
                rotate_inverse(torso_quat, s["torso_velocity"]),
                s["torso_angular_velocity"],
                torch.stack((yaw, roll, angle_to_target, s["up_proj"], s["heading_proj"]), dim=-1),
                s["dof_pos_scaled"],
                s["dof_vel"] * s["dof_vel_scale"],
                s["vec_sensor_tensor"] * s["contact_force_scale"],
                s["actions"],
            ),
            dim=-1,
        )
