"""ANYmal: a 52 kg quadruped walks at commanded velocities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import torch
from torch import Tensor

from ...tasks.deployment import Deployment, Term
from ...tasks.rotations import root_state, rotate, rotate_inverse
from ...tasks.sensors import add_contact_sensor
from ...tasks.task import Recipe, Score, State, Task, mean_over_steps
from ...types import StateSpec, StateVar
from ..assets import REWARDS
from .legged import add_floor

START_HEIGHT = 0.62  # [m]; the feet hang 8 cm above the ground
STIFFNESS, DAMPING, MAX_TORQUE = 85.0, 2.0, 80.0  # [N m/rad], [N m s/rad], [N m] of each joint's drive
TARGET_RANGE = 0.5  # [rad] from the default angle at full action
MAX_COMMAND = (2.0, 1.0, 1.0)  # forward and left [m/s], yaw rate [rad/s]
CONTACT_LIMIT = 1.0  # [N] on base or thigh that ends an episode

# Leg: +1 for front and -1 for hind, +1 for left and -1 for right.
LEGS = {"LF": (1, 1), "LH": (-1, 1), "RF": (1, -1), "RH": (-1, -1)}
PARTS = ("HIP", "THIGH", "SHANK")
BODIES = ("base", *(f"{leg}_{part}" for leg in LEGS for part in PARTS))
THIGHS = slice(BODIES.index("LF_THIGH"), None, len(PARTS))
DEFAULT_ANGLES = tuple(angle for front, left in LEGS.values() for angle in (0.03 * left, 0.4 * front, -0.8 * front))

Vector = tuple[float, float, float]
# Everything touches the ground only: the original runs without self-collision.
_SHAPE = {"contype": 0, "conaffinity": 1}


class Anymal(Task):
    env = "anymal"
    suite = "isaac"
    description = "to make the quadruped follow randomly chosen x, y and yaw target velocities"
    human = REWARDS / "anymal.py"
    score_unit, score_range = "sum of squared velocity errors, negated", (None, 0.0)
    ends = "An episode ends early when something touches the base or a thigh with more than 1 N."
    counts_early = True
    episode_length = 2500
    time_out_early = 1
    control_dt = 0.02
    substeps = 4  # the original takes 2; at 10 ms the soft contacts let standing feet slide at 0.5 m/s
    num_observations = 48
    num_actions = 12
    clip_observations = 5.0
    memory = ("commands",)
    lin_vel_scale = 2.0
    ang_vel_scale = 0.25
    dof_pos_scale = 1.0
    dof_vel_scale = 0.05

    spec = StateSpec(
        (
            StateVar("obs_buf", "observation of the policy, before clipping", (48,)),
            StateVar(
                "root_states",
                "base in the world frame: position [m], quaternion x y z w, linear velocity [m/s], angular "
                "velocity [rad/s]",
                (13,),
            ),
            StateVar("commands", "target velocities in the base frame: forward and left [m/s], yaw rate [rad/s]", (3,)),
            StateVar(
                "dof_pos",
                "joint angles [rad]: hip abduction, hip flexion, knee of the left front, left hind, right "
                "front, right hind leg",
                (12,),
            ),
            StateVar("dof_vel", "joint rates [rad/s]", (12,), use="zero_centred"),
            StateVar("default_dof_pos", "joint angles of the standing pose [rad]", (12,)),
            StateVar("gravity_vec", "direction of gravity (0, 0, -1), world frame", (3,)),
            StateVar("actions", "last action, (target angle - default angle) / 0.5 rad", (12,), use="zero_centred"),
            StateVar("lin_vel_scale", "factor of linear velocities in the observation", kind="float"),
            StateVar("ang_vel_scale", "factor of angular velocities in the observation", kind="float"),
            StateVar("dof_pos_scale", "factor of joint angles in the observation", kind="float"),
            StateVar("dof_vel_scale", "factor of joint rates in the observation", kind="float"),
            StateVar("torques", "joint torques [N m], at most 80", (12,), use="zero_centred"),
            StateVar(
                "contact_forces",
                "net contact force [N], world frame, on the base, then hip, thigh, shank (with foot) of each "
                "leg in joint order",
                (13, 3),
            ),
            StateVar(
                "base_linear_velocity",
                "base velocity [m/s] in the base frame: forward, left, up",
                (3,),
                use="directional",
            ),
            StateVar(
                "base_angular_velocity",
                "base angular velocity [rad/s] in the base frame: roll, pitch, yaw",
                (3,),
                use="zero_centred",
            ),
            StateVar(
                "velocity_error", "forward and left target velocity minus base velocity [m/s]", (2,), use="zero_centred"
            ),
            StateVar("yaw_rate_error", "target minus actual yaw rate [rad/s]", use="zero_centred"),
            StateVar("base_height", "base height [m], about 0.5 when walking", use="directional"),
            StateVar("up_proj", "1 when upright, 0 on the side, -1 upside down", use="directional"),
            StateVar("joint_offsets", "joint angles minus those of the standing pose [rad]", (12,), use="zero_centred"),
        )
    )
    unmeasured = (("base_linear_velocity", range(0, 3)),)
    deployment = Deployment(
        observation=(
            Term("base_linear_velocity", ("lin_vel_scale",)),
            Term("base_angular_velocity", ("ang_vel_scale",)),
            Term("gravity_forward", (1.0,)),
            Term("commands", ("lin_vel_scale", "lin_vel_scale", "ang_vel_scale")),
            Term("joint_offsets", ("dof_pos_scale",)),
            Term("joint_velocities", ("dof_vel_scale",)),
            Term("last_action", (1.0,)),
        ),
        default_pose=DEFAULT_ANGLES,
        action_scale=TARGET_RANGE,
        commands=tuple(
            (name, -most, most) for name, most in zip(("forward", "left", "yaw_rate"), MAX_COMMAND, strict=True)
        ),
    )
    # The original takes 98 M steps with 4096 worlds; fewer worlds and a smaller network learn from fewer steps.
    recipe = Recipe(
        hidden=(128, 64), env_steps=4_000_000, worlds=128, horizon=24, epochs=5, minibatches=4, bounds_coef=1e-3
    )

    @staticmethod
    def model() -> mujoco.MjSpec:
        """ANYmal C's inertias and primitive collision shapes, legs mirrored from the left front one.

        Left out: the 0.14 kg hatch, whose inertia in the original is physically impossible.
        """
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        add_floor(spec, friction=1.0)
        base = spec.worldbody.add_body(name="base", pos=[0, 0, START_HEIGHT])
        base.add_freejoint(name="base")
        _set_inertia(base, 26.23, (-0.0185, -0.0002, 0.0081), (0.214, 1.78, 1.832, 0, 0.059, 0))
        _add_box(base, (0, 0, 0), (0.58, 0.14, 0.18))
        for end in (1, -1):
            _add_box(base, (0.4695 * end, 0, 0), (0.11, 0.14, 0.18))
            for side in (1, -1):
                _add_rod(base, 0.09, (0.2175 * end, 0.07 * side, 0), (0.145, 0, 0))
                _add_rod(base, 0.09, (0.4695 * end, 0.07 * side, 0), (0.11, 0, 0))
        _add_rod(base, 0.07, (-0.364, 0, 0.1335), (0, 0, 0.12))
        for leg in LEGS:
            _add_leg(spec, base, leg)
        for body in BODIES:
            add_contact_sensor(spec, body, mujoco.mjtConDataField.mjCONDATA_FORCE)
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.drive_force = self.sim.bind("qfrc_actuator")
        self.contact = self.sim.bind("sensordata")
        self.default_dof_pos = torch.tensor(DEFAULT_ANGLES, device=self.device).repeat(self.num_envs, 1)
        self.gravity_vec = torch.tensor((0.0, 0.0, -1.0), device=self.device).repeat(self.num_envs, 1)
        self.commands = torch.zeros(self.num_envs, 3, device=self.device)
        self.max_command = torch.tensor(MAX_COMMAND, device=self.device)
        scales = (self.lin_vel_scale, self.lin_vel_scale, self.ang_vel_scale)
        self.command_scale = torch.tensor(scales, device=self.device)

    def apply_action(self, actions: Tensor) -> None:
        self.ctrl[:] = self.default_dof_pos + TARGET_RANGE * actions

    def compute_state(self) -> dict[str, Any]:
        root_states = root_state(self.qpos, self.qvel)
        commands = self.commands.clone()
        dof_pos = self.qpos[:, 7:].clone()
        base_quat = root_states[:, 3:7]
        linear = rotate_inverse(base_quat, root_states[:, 7:10])
        angular = self.qvel[:, 3:6].clone()
        return {
            "root_states": root_states,
            "commands": commands,
            "dof_pos": dof_pos,
            "dof_vel": self.qvel[:, 6:].clone(),
            "default_dof_pos": self.default_dof_pos,
            "gravity_vec": self.gravity_vec,
            "actions": self.actions.clone(),
            "lin_vel_scale": self.lin_vel_scale,
            "ang_vel_scale": self.ang_vel_scale,
            "dof_pos_scale": self.dof_pos_scale,
            "dof_vel_scale": self.dof_vel_scale,
            "torques": self.drive_force[:, 6:].clone(),
            "contact_forces": -self.contact.view(-1, len(BODIES), 3),
            "base_linear_velocity": linear,
            "base_angular_velocity": angular,
            "velocity_error": commands[:, :2] - linear[:, :2],
            "yaw_rate_error": commands[:, 2] - angular[:, 2],
            "base_height": root_states[:, 2],
            "up_proj": -rotate(base_quat, self.gravity_vec)[:, 2],
            "joint_offsets": dof_pos - self.default_dof_pos,
        }

    def observe(self, s: State) -> Tensor:
        return torch.cat(
            (
                s["base_linear_velocity"] * s["lin_vel_scale"],
                s["base_angular_velocity"] * s["ang_vel_scale"],
                rotate(s["root_states"][:, 3:7], s["gravity_vec"]),  # not the inverse rotation, as in the original
                s["commands"] * self.command_scale,
                s["joint_offsets"] * s["dof_pos_scale"],
                s["dof_vel"] * s["dof_vel_scale"],
                s["actions"],
            ),
            dim=-1,
        )

    def terminated(self, s: State) -> Tensor:
        force = s["contact_forces"].norm(dim=-1)
        return (force[:, 0] > CONTACT_LIMIT) | (force[:, THIGHS] > CONTACT_LIMIT).any(dim=-1)

    def reset(self, worlds: Tensor) -> None:
        """In the air, joints near the standing pose, with a command for the whole episode."""
        self.qpos[worlds, 7:] = self.default_dof_pos[worlds] * self.noise.uniform(worlds, 12, 0.5, 1.5)
        self.qvel[worlds, 6:] = self.noise.uniform(worlds, 12, -0.1, 0.1)
        self.commands[worlds] = self.noise.uniform(worlds, 3, -self.max_command, self.max_command)

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_steps(self.sparse_reward(s))

    def sparse_reward(self, s: State) -> Tensor:
        return -s["velocity_error"].square().sum(dim=-1) - s["yaw_rate_error"].square()


def _add_leg(spec: mujoco.MjSpec, base: mujoco.MjsBody, leg: str) -> None:
    """Hip, thigh and shank with their driven joints; lengths are those of the left front leg."""
    front, left = LEGS[leg]

    def place(point: Sequence[float]) -> Vector:
        x, y, z = point
        return (front * x, left * y, z)

    hip = base.add_body(name=f"{leg}_HIP", pos=place((0.2999, 0.104, 0)))
    _set_inertia(hip, 2.781, place((0.0567, 0.0174, -0.0005)), (0.0033, 0.0049, 0.0058, 0, 0, 0))
    _add_rod(hip, 0.05, place((0.0599, 0.01381, 0)), (0, 0.14, 0))
    _add_drive(spec, hip, f"{leg}_HAA", (1, 0, 0), sorted((-0.72 * left, 0.49 * left)))

    thigh = hip.add_body(name=f"{leg}_THIGH", pos=place((0.0599, 0.08381, 0)))
    _set_inertia(thigh, 3.071, place((0, 0.0308, -0.2457)), (0.0299, 0.0296, 0.0049, 0, 0, 0.0041 * left))
    _add_rod(thigh, 0.065, place((0, 0.04, 0)), (0, 0.08, 0))
    _add_box(thigh, place((0, 0.03, -0.1413)), (0.075, 0.06, 0.2826))
    _add_rod(thigh, 0.05, place((0, 0.0303, -0.285)), (0, 0.14, 0))
    _add_drive(spec, thigh, f"{leg}_HFE", (0, 1, 0), (-9.42, 9.42))

    shank = thigh.add_body(name=f"{leg}_SHANK", pos=place((0, 0.1003, -0.285)))
    _set_inertia(shank, 0.588, place((0.0613, 0.0055, -0.0807)), (0.0088, 0.0102, 0.0016, 0, 0.0018 * front, 0))
    _add_rod(shank, 0.0175, place((0.08795, 0.01305, -0.169)), (0, 0, 0.2825))
    foot = place((0.08795, 0.01305, -0.31547))
    shank.add_geom(name=f"{leg}_FOOT", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0], pos=foot, **_SHAPE)
    _add_drive(spec, shank, f"{leg}_KFE", (0, 1, 0), (-9.42, 9.42))


def _add_drive(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, axis: Vector, limits: Sequence[float]) -> None:
    body.add_joint(name=name, axis=axis, limited=True, range=limits)
    drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.set_to_position(kp=STIFFNESS, kv=DAMPING)
    drive.forcelimited = True
    drive.forcerange = [-MAX_TORQUE, MAX_TORQUE]


def _set_inertia(body: mujoco.MjsBody, mass: float, centre: Vector, inertia: Sequence[float]) -> None:
    """Inertia xx, yy, zz, xy, xz, yz about the centre of mass, in the body's axes."""
    body.explicitinertial = True
    body.mass, body.ipos, body.fullinertia = mass, centre, inertia


def _add_box(body: mujoco.MjsBody, centre: Vector, size: Vector) -> None:
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=centre, size=[edge / 2 for edge in size], **_SHAPE)


def _add_rod(body: mujoco.MjsBody, radius: float, centre: Vector, axis: Vector) -> None:
    """A capsule whose straight part is `axis`: the original loads its cylinders with round ends added."""
    ends = [point + sign * part / 2 for sign in (-1, 1) for point, part in zip(centre, axis, strict=True)]
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=ends, **_SHAPE)
