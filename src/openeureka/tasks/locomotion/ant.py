"""Ant: four legs of two joints carry a light torso forward."""

from __future__ import annotations

from typing import Any

import mujoco
import torch
from torch import Tensor

from ...types import StateSpec, StateVar
from ..rotations import euler_xyz, root_state, rotate, rotate_inverse
from ..task import Recipe, State
from .common import Runner, add_floor, add_foot_sensors, scaled

TORQUE = 15.0  # [N m] at full action
DENSITY = 5.0  # [kg/m3]
# PhysX averages the friction of a pair, robot 1.5 and ground 1.0; MuJoCo takes the larger, so both get the average.
FRICTION = 1.25
# Leg: direction of its diagonal in x and y, ankle axis, ankle range [deg].
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
    episode_length = 1000
    control_dt = 0.0166
    substeps = 2
    num_observations = 60
    num_actions = 8
    feet = tuple(f"{leg}_foot" for leg in LEGS)
    start_height = 0.44
    fall_height = 0.31

    spec = StateSpec(
        (
            StateVar(name="obs_buf", shape=(60,), meaning="observation of the policy, before clipping"),
            StateVar(
                name="root_states",
                shape=(13,),
                meaning="torso in the world frame: position [m], quaternion x y z w, linear velocity [m/s], angular "
                "velocity [rad/s]; column 7 is the forward speed",
            ),
            StateVar(name="targets", shape=(3,), meaning="target position [m], 1000 m ahead along x"),
            StateVar(name="potentials", meaning="minus horizontal distance to the target / dt; grows by the speed"),
            StateVar(name="prev_potentials", meaning="potentials one step ago; the difference is forward speed [m/s]"),
            StateVar(name="up_vec", shape=(3,), meaning="up axis of the torso in the world frame"),
            StateVar(name="heading_vec", shape=(3,), meaning="forward axis of the torso in the world frame"),
            StateVar(name="dof_pos", shape=(8,), meaning="joint angles [rad], hip and ankle of each leg"),
            StateVar(name="dof_vel", shape=(8,), meaning="joint rates [rad/s]", use="zero_centred"),
            StateVar(name="dof_limits_lower", shape=(8,), kind="constant", meaning="lower joint limits [rad]"),
            StateVar(name="dof_limits_upper", shape=(8,), kind="constant", meaning="upper joint limits [rad]"),
            StateVar(
                name="vec_sensor_tensor",
                shape=(24,),
                meaning="contact force [N] and torque [N m] of each foot, in the foot's frame",
            ),
            StateVar(name="actions", shape=(8,), meaning="last action, torque / 15 N m", use="zero_centred"),
            StateVar(name="inv_start_rot", shape=(4,), meaning="inverse of the start orientation, x y z w"),
            StateVar(name="basis_vec0", shape=(3,), meaning="forward axis (1, 0, 0)"),
            StateVar(name="basis_vec1", shape=(3,), meaning="up axis (0, 0, 1)"),
            StateVar(name="dt", kind="float", meaning="control time step 0.0166 [s]"),
            StateVar(name="dof_vel_scale", kind="float", meaning="scale of joint rates in the observation, 0.2"),
            StateVar(name="contact_force_scale", kind="float", meaning="scale of foot wrenches there, 0.1"),
            StateVar(name="up_axis_idx", kind="int", meaning="index of the vertical axis, 2"),
            StateVar(
                name="torso_velocity",
                shape=(3,),
                meaning="torso velocity [m/s] in the world frame: forward, left, up",
                use="directional",
            ),
            StateVar(
                name="torso_angular_velocity",
                shape=(3,),
                meaning="torso angular velocity [rad/s] in the torso frame",
                use="zero_centred",
            ),
            StateVar(name="torso_height", meaning="torso height [m], about 0.5 when walking", use="directional"),
            StateVar(name="up_proj", meaning="1 when upright, 0 on the side, -1 on the back", use="directional"),
            StateVar(name="heading_proj", meaning="1 when facing the target, -1 when facing away", use="directional"),
            StateVar(
                name="dof_pos_scaled",
                shape=(8,),
                meaning="joint angles as a share of their range, -1 and 1 at the limits",
                use="zero_centred",
            ),
        )
    )
    # The original takes 32.8 M steps with 4096 worlds; fewer worlds and a smaller network learn from fewer steps.
    recipe = Recipe(
        hidden=(128, 64), env_steps=6_000_000, worlds=512, horizon=16, epochs=4, minibatches=2, reward_scale=0.01
    )

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        add_floor(spec, FRICTION)
        torso = spec.worldbody.add_body(name="torso", pos=[0, 0, Ant.start_height])
        torso.add_freejoint(name="root")
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
        add_foot_sensors(spec, Ant.feet)
        return spec

    def compute_state(self) -> dict[str, Any]:
        root_states = root_state(self.qpos, self.qvel)
        torso_position, torso_quat = root_states[:, :3], root_states[:, 3:7]
        dof_pos, dof_vel = self.qpos[:, 7:].clone(), self.qvel[:, 6:].clone()
        up_vec = rotate(torso_quat, self.basis_vec1)
        heading_vec = rotate(torso_quat, self.basis_vec0)
        to_target = self.targets[:, :2] - torso_position[:, :2]
        target_dirs = torch.nn.functional.normalize(to_target, dim=-1)
        return {
            "root_states": root_states,
            "targets": self.targets,
            "potentials": self.potential(torso_position),
            "prev_potentials": self.prev_potentials.clone(),
            "up_vec": up_vec,
            "heading_vec": heading_vec,
            "dof_pos": dof_pos,
            "dof_vel": dof_vel,
            "dof_limits_lower": self.dof_limits_lower,
            "dof_limits_upper": self.dof_limits_upper,
            "vec_sensor_tensor": self.foot_wrenches(),
            "actions": self.actions.clone(),
            "inv_start_rot": self.inv_start_rot,
            "basis_vec0": self.basis_vec0,
            "basis_vec1": self.basis_vec1,
            "dt": self.control_dt,
            "dof_vel_scale": 0.2,
            "contact_force_scale": 0.1,
            "up_axis_idx": 2,
            "torso_velocity": root_states[:, 7:10],
            "torso_angular_velocity": self.qvel[:, 3:6].clone(),
            "torso_height": torso_position[:, 2],
            "up_proj": up_vec[:, 2],
            "heading_proj": (heading_vec[:, :2] * target_dirs).sum(dim=-1),
            "dof_pos_scaled": scaled(dof_pos, self.dof_limits_lower, self.dof_limits_upper),
        }

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

    def human_reward(self, s: State) -> Tensor:
        effort = 0.005 * s["actions"].square().sum(dim=-1)
        energy = 0.05 * (s["actions"] * s["dof_vel"] * s["dof_vel_scale"]).abs().sum(dim=-1)
        at_limit = 0.1 * (s["dof_pos_scaled"] > 0.99).sum(dim=-1)
        reward = self.sparse_reward(s) + 0.5 + self.posture_reward(s) - effort - energy - at_limit
        return torch.where(self.terminated(s), -2.0, reward)
