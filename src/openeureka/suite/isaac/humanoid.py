"""Humanoid: 21 joints, 41 kg, running upright.

The legs can collide, and in a quarter of the episodes the original's random start angles make them overlap by up to
10 cm. It is kept: contacts part them within a few steps, at joint speeds below 30 rad/s, against 15 rad/s in other
falls.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import torch
from torch import Tensor

from ...tasks.rotations import euler_xyz, rotate_inverse
from ...tasks.sensors import add_wrench_sensors
from ...tasks.task import Recipe, State
from ...types import StateSpec, StateVar
from ..assets import REWARDS
from .legged import Runner, add_floor, running_variables

Vector = tuple[float, float, float]


class Joint(NamedTuple):
    """A hinge with the passive spring and damper that the original's model file gives it."""

    name: str
    axis: Vector
    """In the right or middle body's frame, to be normalised."""
    range: tuple[float, float]
    """[deg]"""
    stiffness: float
    """[N m/rad] towards angle 0."""
    damping: float
    """[N m s/rad]"""
    armature: float
    """[kg m2]"""
    torque: float
    """[N m] at full action."""
    at: Vector = (0.0, 0.0, 0.0)
    """Anchor in the body's frame [m]."""
    mirrored: bool = True
    """Whether the left side turns the opposite way about x and z; the original leaves one joint as it is."""


class Part(NamedTuple):
    """A body of the right side or the middle; x is forward, y left, z up, all lengths in metres."""

    name: str
    parent: str
    at: Vector
    capsules: tuple[tuple[float, Vector, Vector], ...]
    """Radius and both end points; a sphere has equal ones."""
    joints: tuple[Joint, ...] = ()
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """Orientation in the parent, w x y z, to be normalised."""


TRUNK = (
    Part(
        "torso",
        "world",
        (0, 0, 1.34),
        ((0.07, (0, -0.07, 0), (0, 0.07, 0)), (0.06, (-0.01, -0.06, -0.12), (-0.01, 0.06, -0.12))),
    ),
    Part("head", "torso", (0, 0, 0.19), ((0.09, (0, 0, 0), (0, 0, 0)),)),
    Part(
        "lower_waist",
        "torso",
        (-0.01, 0, -0.26),
        ((0.06, (0, -0.06, 0), (0, 0.06, 0)),),
        (
            Joint("abdomen_z", (0, 0, 1), (-45, 45), 20, 5, 0.02, 67.5, at=(0, 0, 0.065)),
            Joint("abdomen_y", (0, 1, 0), (-75, 30), 20, 5, 0.01, 67.5, at=(0, 0, 0.065)),
        ),
        quat=(1, 0, -0.002, 0),
    ),
    Part(
        "pelvis",
        "lower_waist",
        (0, 0, -0.165),
        ((0.09, (-0.02, -0.07, 0), (-0.02, 0.07, 0)),),
        (Joint("abdomen_x", (1, 0, 0), (-35, 35), 10, 5, 0.01, 67.5, at=(0, 0, 0.1)),),
        quat=(1, 0, -0.002, 0),
    ),
)
LEG = (
    Part(
        "thigh",
        "pelvis",
        (0, -0.1, -0.04),
        ((0.06, (0, 0, 0), (0, 0.01, -0.34)),),
        (
            Joint("hip_x", (1, 0, 0), (-45, 15), 10, 5, 0.01, 45),
            Joint("hip_z", (0, 0, 1), (-60, 35), 10, 5, 0.01, 45),
            Joint("hip_y", (0, 1, 0), (-120, 45), 20, 5, 0.01, 135),
        ),
    ),
    Part(
        "shin",
        "thigh",
        (0, 0.01, -0.403),
        ((0.049, (0, 0, 0), (0, 0, -0.3)),),
        (Joint("knee", (0, -1, 0), (-160, 2), 5, 0.1, 0.007, 90, at=(0, 0, 0.02)),),
    ),
    Part(
        "foot",
        "shin",
        (0, 0, -0.39),
        ((0.027, (-0.07, -0.02, 0), (0.14, -0.04, 0)), (0.027, (-0.07, 0, 0), (0.14, 0.02, 0))),
        (
            Joint("ankle_y", (0, 1, 0), (-50, 50), 2, 1, 0.006, 22.5, at=(0, 0, 0.08)),
            Joint("ankle_x", (1, 0, 0.5), (-50, 50), 2, 1, 0.006, 22.5, at=(0, 0, 0.08), mirrored=False),
        ),
    ),
)
ARM = (
    Part(
        "upper_arm",
        "torso",
        (0, -0.17, 0.06),
        ((0.04, (0, 0, 0), (0.16, -0.16, -0.16)),),
        (
            Joint("shoulder1", (2, 1, 1), (-90, 70), 10, 5, 0.01, 67.5),
            Joint("shoulder2", (0, -1, 1), (-90, 70), 10, 5, 0.01, 67.5),
        ),
    ),
    Part(
        "lower_arm",
        "upper_arm",
        (0.18, -0.18, -0.18),
        ((0.031, (0.01, 0.01, 0.01), (0.17, 0.17, 0.17)),),
        (Joint("elbow", (0, -1, 1), (-90, 50), 2, 1, 0.006, 45),),
    ),
    Part("hand", "lower_arm", (0.18, 0.18, 0.18), ((0.04, (0, 0, 0), (0, 0, 0)),)),
)
SIDES = {"right": 1, "left": -1}


class Humanoid(Runner):
    env = "humanoid"
    suite = "isaac"
    description = "to make the humanoid run as fast as possible"
    human = REWARDS / "humanoid.py"
    episode_length = 1000
    control_dt = 0.0166
    substeps = 3  # the original takes 2; MuJoCo's softer contacts need steps below 6 ms under random torques
    num_observations = 108
    num_actions = 21
    feet = ("right_foot", "left_foot")
    start_height = 1.34
    fall_height = 0.8
    ends = "An episode ends early when the torso is less than 0.8 m above the ground."
    dof_vel_scale = 0.1
    contact_force_scale = 0.01
    angular_velocity_scale = 0.25
    dof_force_scale = 0.01

    spec = StateSpec(
        (
            StateVar("obs_buf", "observation of the policy, before clipping", (108,)),
            *running_variables(
                joints="abdomen z y x; right hip x z y, knee, ankle y x; the same left; right shoulder 1 2, elbow; "
                "the same left",
                dofs=21,
                feet=2,
                torque="torque / maximum torque of the joint",
                standing="about 1.3 when standing",
            ),
            StateVar("dof_force_tensor", "joint torques of motors, springs, dampers [N m]", (21,)),
            StateVar("angular_velocity_scale", "factor of angular velocity in the observation", kind="float"),
        )
    )
    # The original takes 131 M steps with 4096 worlds; fewer worlds and a smaller network learn from fewer steps.
    recipe = Recipe(
        hidden=(128, 128),
        env_steps=20_000_000,
        worlds=512,
        horizon=32,
        epochs=4,
        minibatches=4,
        learning_rate=5e-4,
        critic_coef=4.0,
        reward_scale=0.01,
    )

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        add_floor(spec, friction=1.0)
        for part in TRUNK:
            add_part(spec, part)
        for chain in (LEG, ARM):
            for side in SIDES:
                for part in chain:
                    add_part(spec, part, side)
        add_wrench_sensors(spec, Humanoid.feet)
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.actuator_force = self.sim.bind("qfrc_actuator")
        self.passive_force = self.sim.bind("qfrc_passive")

    def compute_state(self) -> dict[str, Any]:
        return {
            **super().compute_state(),
            "dof_force_tensor": self.actuator_force[:, 6:] + self.passive_force[:, 6:],
            "angular_velocity_scale": self.angular_velocity_scale,
        }

    def observe(self, s: State) -> Tensor:
        torso_quat = s["root_states"][:, 3:7]
        roll, _, yaw = euler_xyz(torso_quat)
        to_target = s["targets"] - s["root_states"][:, :3]
        angle_to_target = torch.atan2(to_target[:, 2], to_target[:, 0]) - yaw  # z, not y, as in the original
        return torch.cat(
            (
                s["torso_height"][:, None],
                rotate_inverse(torso_quat, s["torso_velocity"]),
                s["torso_angular_velocity"] * s["angular_velocity_scale"],
                wrap(torch.stack((yaw, roll, angle_to_target), dim=-1)),
                torch.stack((s["up_proj"], s["heading_proj"]), dim=-1),
                s["dof_pos_scaled"],
                s["dof_vel"] * s["dof_vel_scale"],
                s["dof_force_tensor"] * self.dof_force_scale,
                s["vec_sensor_tensor"] * s["contact_force_scale"],
                s["actions"],
            ),
            dim=-1,
        )


def add_part(spec: mujoco.MjSpec, part: Part, side: str = "") -> None:
    """Add a body with its geoms, joints and motors; a side names it and, on the left, mirrors it in the plane y = 0."""
    prefix = f"{side}_" if side else ""
    mirror = SIDES.get(side, 1)

    def place(point: Vector) -> list[float]:
        return [point[0], mirror * point[1], point[2]]

    parent = spec.body(f"{prefix}{part.parent}") or spec.body(part.parent)
    body = parent.add_body(name=f"{prefix}{part.name}", pos=place(part.at), quat=part.quat)
    if parent is spec.worldbody:
        body.add_freejoint(name="root")
    for joint in part.joints:
        turn = mirror if joint.mirrored else 1  # a mirrored axis keeps its y part, for the same sense of rotation
        name = f"{prefix}{joint.name}"
        body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE,
            pos=place(joint.at),
            axis=[turn * joint.axis[0], joint.axis[1], turn * joint.axis[2]],
            range=joint.range,
            limited=True,
            stiffness=[joint.stiffness, 0, 0],
            damping=[joint.damping, 0, 0],
            armature=joint.armature,
        )
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gear[0] = joint.torque
    for radius, start, end in part.capsules:
        if start == end:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], pos=place(start))
        else:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=[*place(start), *place(end)])


def wrap(angle: Tensor) -> Tensor:
    """Angles in [-pi, pi]."""
    return torch.atan2(angle.sin(), angle.cos())
