"""Franka Panda: the arm that gymnasium-robotics ships, with the joints, drives and masses of the original's URDF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import mujoco

from ..assets import wheel_file

ARM_RANGES = (
    (-2.8973, 2.8973),
    (-1.7628, 1.7628),
    (-2.8973, 2.8973),
    (-3.0718, -0.0698),
    (-2.8973, 2.8973),
    (-0.0175, 3.7525),
    (-2.8973, 2.8973),
)  # [rad]
FINGER_RANGE = (0.0, 0.04)  # [m]
EFFORT = (*[87.0] * 4, *[12.0] * 3, *[200.0] * 2)  # [N m, N]
MAX_SPEED = (*[2.175] * 4, *[2.61] * 3, *[0.2] * 2)  # [rad/s, m/s]
# The original's fingers have 1e6 and 100, which diverges here. With these, a finger that is 2 cm from its target pushes
# with its full effort, and moves at its speed limit.
STIFFNESS = (*[400.0] * 7, *[1e4] * 2)
DAMPING = (*[80.0] * 7, *[1e3] * 2)
# [kg m^2, kg] The less mass is behind a contact, the softer it is: fingers of 22 g would sink 6 mm into what they hold.
ARMATURE = (*[0.1] * 7, *[1.0] * 2)
# A drive whose target is this far ahead of the joint moves it at the joint's speed limit, which PhysX enforces.
MAX_LEAD = tuple(
    speed * damping / stiffness for speed, damping, stiffness in zip(MAX_SPEED, DAMPING, STIFFNESS, strict=True)
)
JOINTS = (*(f"panda_joint{i}" for i in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2")

_FOLDER = "envs/assets/kitchen_franka/franka_assets"
_FINGER = (0.0105, 0.0132, 0.027)  # half extents [m] of the finger's mesh, whose inner face is at y = 0
_FINGER_MASS = 0.022  # [kg]


def franka_spec(*, pos: Sequence[float], quat: Sequence[float], contype: int, conaffinity: int) -> mujoco.MjSpec:
    """A spec that holds the arm, its base fixed at `pos` and `quat` (w, x, y, z), without gravity on it.

    Bodies are panda_link0 .. panda_link7, panda_leftfinger and panda_rightfinger, joints and drives `JOINTS`. Links
    collide as the convex hulls of their meshes, which also give their masses, fingers as boxes.
    """
    chain = wheel_file("gymnasium_robotics", f"{_FOLDER}/chain.xml")
    spec = mujoco.MjSpec.from_string(
        f"<mujoco><include file='{chain.with_name('assets.xml')}'/>"
        f"<worldbody><include file='{chain}'/></worldbody></mujoco>"
    )
    for mesh in spec.meshes:
        file = Path(mesh.file)  # relative to a folder that the scene of the wheel sets
        mesh.file = str(chain.with_name("meshes") / file.parent.name / file.name)
        mesh.scale = [1, 1, 1]  # the wheel's fingers are longer
        if mesh.name.endswith("_col"):
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    for body in spec.bodies[1:]:
        body.name = body.name.replace("panda0_", "panda_")
        body.gravcomp = 1.0
    base = spec.body("panda_link0")
    base.pos, base.quat = pos, quat
    _straighten_wrist(spec)
    _collide(spec, contype, conaffinity)
    _drive(spec)
    return spec


def _straighten_wrist(spec: mujoco.MjSpec) -> None:
    """Undo the wheel's turn of the frames of links 6 and 7 about their joints, by 90 and 45 degrees."""
    for name in ("panda_link6", "panda_link7"):
        body = spec.body(name)
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        body.quat = [math.sqrt(0.5), math.sqrt(0.5), 0, 0]


def _collide(spec: mujoco.MjSpec, contype: int, conaffinity: int) -> None:
    """Replace the collision geoms' masses, the fingers' geoms and the collision filters."""
    for geom in spec.geoms:
        if not geom.meshname:
            spec.delete(geom)  # capsules along the longer fingers
        elif geom.meshname.endswith("_col"):
            geom.mass, geom.density = math.nan, 1000
            geom.contype, geom.conaffinity = contype, conaffinity
    for name, side in (("panda_leftfinger", 1.0), ("panda_rightfinger", -1.0)):
        finger = spec.body(name)
        finger.explicitinertial, finger.ipos = False, [math.nan] * 3  # mass and inertia follow from the geoms
        finger.add_geom(
            spec.default,  # not those of the wheel's fingers
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=_FINGER,
            pos=[0, side * _FINGER[1], _FINGER[2]],
            mass=_FINGER_MASS,
            contype=contype,
            conaffinity=conaffinity,
            group=3,
        )


def _drive(spec: mujoco.MjSpec) -> None:
    """Name and limit the joints as the original, and put a position drive on each."""
    ranges = (*ARM_RANGES, FINGER_RANGE, FINGER_RANGE)
    for i, joint in enumerate(spec.joints):
        joint.name, joint.range = JOINTS[i], ranges[i]
        joint.damping, joint.armature = [0, 0, 0], ARMATURE[i]
        drive = spec.add_actuator(name=JOINTS[i], target=JOINTS[i], trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=STIFFNESS[i], kv=DAMPING[i])
        drive.forcelimited, drive.forcerange = True, [-EFFORT[i], EFFORT[i]]
