"""Primitives that the objects are made of."""

from __future__ import annotations

import math

import mujoco

from ..angles import quaternion

Vector = tuple[float, float, float]

MATTER = {"contype": 2, "conaffinity": 3}
"""Objects and tables touch one another and the hands, whose geoms have contype 1."""


LINK = quaternion(math.pi / 2, 0, -math.pi / 2)  # frame of the original's links (y up) in the base frame (z up)
EGGSHELL, PLASTIC, METAL = (0.95, 0.9, 0.75, 1), (0.35, 0.55, 0.8, 1), (0.65, 0.67, 0.7, 1)


def add_box(body: mujoco.MjsBody, lower: Vector, upper: Vector, *, mass: float = 0.0, friction: float = 1.0) -> None:
    """A box from corner to corner."""
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[(a + b) / 2 for a, b in zip(lower, upper, strict=True)],
        size=[(b - a) / 2 for a, b in zip(lower, upper, strict=True)],
        mass=mass,
        rgba=PLASTIC,
        **surface(friction),
    )


def add_cylinder(
    body: mujoco.MjsBody, start: Vector, end: Vector, radius: float, *, mass: float = 0.0, friction: float = 1.0
) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=[*start, *end],
        size=[radius, 0, 0],
        mass=mass,
        rgba=PLASTIC,
        **surface(friction),
    )


def add_rod(body: mujoco.MjsBody, start: Vector, end: Vector, radius: float, *, mass: float = 0.0) -> None:
    """A capsule, whose round ends stick out beyond start and end."""
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*start, *end],
        size=[radius, 0, 0],
        mass=mass,
        rgba=METAL,
        **surface(1.0),
    )


def add_loop(
    body: mujoco.MjsBody,
    near: float,
    far: float,
    z: tuple[float, float],
    *,
    y: float,
    width: float,
    mass: float,
    friction: float = 1.0,
) -> None:
    """A D-shaped handle of three bars that stands out along x from `near` to `far`, `width` wide in y around `y`."""
    bar = 0.01
    grip = far - math.copysign(bar, far - near)
    bars = (
        ((near, z[1] - bar), (grip, z[1])),
        ((near, z[0]), (grip, z[0] + bar)),
        ((grip, z[0]), (far, z[1])),
    )
    for (x0, bottom), (x1, top) in bars:
        lower = (min(x0, x1), y - width / 2, bottom)
        upper = (max(x0, x1), y + width / 2, top)
        add_box(body, lower, upper, mass=mass / len(bars), friction=friction)


def surface(friction: float) -> dict[str, object]:
    """MuJoCo takes the larger friction of a pair, so that any value but 1 needs priority; PhysX averages."""
    return {**MATTER, "friction": [friction, 0.005, 0.0001], "priority": int(friction != 1.0)}


def set_inertia(body: mujoco.MjsBody, mass: float, inertia: Vector) -> None:
    """About the body's origin, whatever its shapes."""
    body.explicitinertial = True
    body.mass, body.inertia = mass, inertia
    body.ipos, body.iquat = (0, 0, 0), (1, 0, 0, 0)  # unset, MuJoCo takes the body's own pose


def add_slide(
    body: mujoco.MjsBody,
    name: str,
    axis: Vector,
    travel: tuple[float, float],
    *,
    pos: Vector = (0, 0, 0),
    stiffness: float = 0.0,
    damping: float = 0.0,
) -> None:
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=axis,
        pos=pos,
        range=travel,
        limited=True,
        stiffness=[stiffness, 0, 0],
        damping=[damping, 0, 0],
    )


def add_hinge(
    body: mujoco.MjsBody,
    name: str,
    axis: Vector,
    travel: tuple[float, float],
    *,
    pos: Vector,
    damping: float,
    stiffness: float = 0.0,
    springref: float = 0.0,
    armature: float = 0.0,
    friction: float = 0.0,
) -> None:
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=axis,
        range=travel,
        limited=True,
        pos=pos,
        stiffness=[stiffness, 0, 0],
        damping=[damping, 0, 0],
        springref=springref,
        armature=armature,
        frictionloss=friction,
    )
