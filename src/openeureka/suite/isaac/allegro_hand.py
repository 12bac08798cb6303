"""AllegroHand: three fingers and a thumb of four joints each turn a 6.5 cm cube in the palm."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import mujoco

from ...types import StateSpec
from ..angles import quaternion
from ..assets import REWARDS
from .reorientation import Reorientation, Vector, add_cube, hand_variables, reorientation_recipe

STIFFNESS = 3.0  # [N m/rad]
DAMPING = 0.1  # [N m s/rad]
MAX_TORQUE = 0.5  # [N m]
ARMATURE = 0.001  # [kg m2]
MAX_SPEED = 6.283  # [rad/s]
# The original clamps joint speeds. Cubic damping balances the drives' largest torque at MAX_SPEED; at 2 rad/s it is 3 %
# of that torque.
SPEED_DAMPING = (0.0, 0.0, MAX_TORQUE / MAX_SPEED**3)


class Shape(NamedTuple):
    """A capsule along a link's x axis, or a box where `half` is given; metres in the link's frame."""

    mass: float
    radius: float = 0.0
    span: tuple[float, float] = (0.0, 0.0)
    """x of the outermost points."""
    y: float = 0.0
    half: Vector = (0.0, 0.0, 0.0)
    at: Vector = (0.0, 0.0, 0.0)
    """Centre of the box."""


class Link(NamedTuple):
    """A link, which turns about its z axis."""

    offset: Vector
    """From the joint before it [m]."""
    turn: Vector
    """Roll, pitch and yaw of its frame in that of the link before [rad]."""
    range: tuple[float, float]
    """[rad]"""
    shapes: tuple[Shape, ...]


SPREAD, CURL, STRAIGHT = (-0.558489, 0.558489), (-0.279244, 1.727825), (0.0, 0.0, 0.0)
INWARD = (3.1415, -1.57075, 0.0)
FINGER = (
    Link((0.0, 0.0, 0.0), (3.1415, -1.57075, 1.57075), CURL, (Shape(0.065, 0.0125, (-0.009, 0.063), -0.0025),)),
    Link((0.054, 0.0, 0.0), STRAIGHT, CURL, (Shape(0.0355, 0.0125, (-0.006, 0.047), -0.0025),)),
    Link(
        (0.0384, 0.0, 0.0),
        STRAIGHT,
        CURL,
        (Shape(0.0096, 0.011, (-0.006, 0.037)), Shape(0.021, 0.0085, (0.034, 0.062), 0.0055)),
    ),
)
KNUCKLE = (Shape(0.0119, half=(0.010, 0.0135, 0.011)),)
FINGERS = {
    "index": (Link((0.0514302, -0.03632, -0.0113), (3.1415, -1.57075, -0.0872639), SPREAD, KNUCKLE), *FINGER),
    "middle": (Link((0.0537375, 0.0087771, -0.0113), (3.1415, -1.57075, 0.0), SPREAD, KNUCKLE), *FINGER),
    "ring": (Link((0.0514302, 0.0538749, -0.0113), (3.1415, -1.57075, 0.0872639), SPREAD, KNUCKLE), *FINGER),
    "thumb": (
        Link(
            (-0.0367482, -0.0081281, -0.0295),
            (-1.57075, -1.57075, 1.483486),
            (0.279244, 1.570750),
            (Shape(0.0176, half=(0.017, 0.023, 0.0215)),),
        ),
        Link(
            (0.005, 0.0, 0.0),
            (1.57075, 0.0, 0.0),
            (-0.331603, 1.151883),
            (Shape(0.0119, half=(0.0135, 0.010, 0.011), at=(0.0, 0.0, 0.051)),),
        ),
        Link((0.0, 0.0, 0.0554), INWARD, CURL, (Shape(0.038, 0.0125, (-0.009, 0.058), -0.0025),)),
        Link(
            (0.0514, 0.0, 0.0),
            STRAIGHT,
            (-0.279244, 1.762731),
            (Shape(0.0388, 0.011, (-0.009, 0.052)), Shape(0.021, 0.0085, (0.049, 0.077), 0.005)),
        ),
    ),
}
DOFS = 16


class AllegroHand(Reorientation):
    env = "allegro_hand"
    description = "to make the hand spin the object to a target orientation"
    human = REWARDS / "cube_in_hand.py"
    control_dt = 0.03334
    substeps = 4
    num_observations = 88
    num_actions = DOFS
    object_start = (0.0, -0.2, 0.59)  # the original starts 3 cm lower, with fingers up to 2 cm inside the cube
    goal_position = (0.0, -0.2, 0.52)

    spec = StateSpec(
        hand_variables(
            joints="spread and three curls of index, middle and ring finger; thumb 0 to 3",
            dofs=DOFS,
            actions=DOFS,
            observations=88,
        )
    )
    recipe = reorientation_recipe(hidden=(256, 128))

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        mount = spec.worldbody.add_body(
            name="mount",
            pos=[0, 0, 0.5],
            quat=[0.257551, 0.283045, 0.683330, -0.621782],
            mass=0.05,
            inertia=[1e-4] * 3,
            explicitinertial=True,
        )
        palm = mount.add_body(name="palm", pos=[-0.008219, -0.02063, 0.08086], quat=quaternion(0.0, -1.5708, 0.785398))
        add_shape(palm, "palm", Shape(0.4154, half=(0.050, 0.0585, 0.049), at=(-0.008, 0.0085, -0.049)))
        for finger, links in FINGERS.items():
            parent = palm
            for index, link in enumerate(links):
                parent = add_link(spec, parent, f"{finger}_{index}", link)
        for one, other in combinations(FINGERS, 2):
            add_finger_contacts(spec, one, other)
        add_cube(spec, side=0.065, density=400, start=AllegroHand.object_start, goal=AllegroHand.goal_position)
        return spec


def add_link(spec: mujoco.MjSpec, parent: mujoco.MjsBody, name: str, link: Link) -> mujoco.MjsBody:
    """A body with its hinge, drive and shapes."""
    body = parent.add_body(name=name, pos=link.offset, quat=quaternion(*link.turn), gravcomp=1)
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0, 0, 1],
        range=link.range,
        limited=True,
        armature=ARMATURE,
        damping=SPEED_DAMPING,
    )
    drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.set_to_position(kp=STIFFNESS, kv=DAMPING)
    drive.ctrlrange, drive.ctrllimited = link.range, True
    drive.forcerange, drive.forcelimited = [-MAX_TORQUE, MAX_TORQUE], True
    for suffix, shape in zip(("", "_tip"), link.shapes, strict=False):
        add_shape(body, name + suffix, shape)
    return body


def add_shape(body: mujoco.MjsBody, name: str, shape: Shape) -> None:
    """Add a shape that touches the cube. Contacts between fingers are left to `add_finger_contacts`."""
    common = {"name": name, "mass": shape.mass, "contype": 1, "conaffinity": 0}
    if any(shape.half):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=shape.half, pos=shape.at, **common)
        return
    start, end = shape.span[0] + shape.radius, shape.span[1] - shape.radius
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[shape.radius, 0, 0],
        fromto=[start, shape.y, 0, end, shape.y, 0],
        **common,
    )


def add_finger_contacts(spec: mujoco.MjSpec, one: str, other: str) -> None:
    """Make the outer links of two fingers collide, without friction, which they may have in the original."""
    outer = ("2", "3", "3_tip")
    for a in outer:
        for b in outer:
            spec.add_pair(name=f"{one}_{a} {other}_{b}", geomname1=f"{one}_{a}", geomname2=f"{other}_{b}", condim=1)
