"""Two Shadow Hands, both right ones as in the original, and what is between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco

from ...tasks.sensors import add_wrench_sensors
from ..angles import quaternion
from ..shadow import FINGERS, FINGERTIPS, add_shadow_hand
from .frames import add_body_sensors, add_site_sensors
from .objects import Thing
from .shapes import LINK, MATTER, Vector

SIDES = ("right", "left")
TIPS = tuple(f"{side}_{tip}" for side in SIDES for tip in FINGERTIPS)
"""Bodies of the fingertips, in the order of every array."""

HAND_BODIES = 26

PALM_POINT: Vector = (0, -0.02, 0.08)
"""Where a hand's position is measured, in the palm's frame [m]."""

_MASS = 5.01  # [kg] of a hand
_INERTIA = 0.0265  # [kg m2] about a transverse axis
_CENTRE = (0.001, 0.008, 0.29)  # [m] centre of mass of the forearm in the mount's frame; the hand's is 2 mm from it
_DRAG = 100.0  # [1/s]
_OTHER_HAND = 4  # collision bit


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Of a goal, or of a hand's mount: unturned, the fingers point along -y and the palm faces up."""

    pos: Vector
    euler: Vector = (0.0, 0.0, 0.0)
    """Turns about x, then y, then z of the world [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """A thing at its start pose."""

    thing: Thing
    pos: Vector
    euler: Vector = (0.0, 0.0, 0.0)
    fixed: bool = False
    points: Mapping[str, Vector] = field(default_factory=dict)
    """Points of interest in the thing's base frame [m], by the name of their state variables."""
    link_points: Mapping[str, Vector] = field(default_factory=dict)
    """Further points, which the original turns like its links."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A box on the floor that does not move."""

    size: Vector
    centre: tuple[float, float] = (0.0, 0.0)
    friction: float = 1.0
    """Friction of every contact with the table, unless it is 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What one world holds.

    Sensors have the names of the state variables: the palms are `right_hand` and `left_hand`, the points at the ends of
    the fingers `right_hand_ff`, ..., the mounts `right_base` and `left_base`.
    """

    right: Pose
    left: Pose
    things: Mapping[str, Placed]
    """By the name of their state variables; `object` is the main one."""
    goals: Mapping[str, Pose] = field(default_factory=dict)
    """Start values of the goals' state variables, by name: `goal` is that of `object`; only pictures show them."""
    marker: Pose | None = None
    """What `goal_states` holds where it is not the state of `goal`."""
    table: Table | None = None
    hands_move: bool = True
    """Whether forces drive the hands' bases; else they are fixed."""
    hands_touch: bool = False
    """Whether the hands meet or pass through each other; the fingers of one hand touch in either case."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Joints that do not start at 0 [rad or m]."""

    def build(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.worldbody.add_light(pos=[0, 0, 5])
        spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3, 3, 0.1], **MATTER)
        for side, hand in zip(SIDES, (self.right, self.left), strict=True):
            self._add_hand(spec, side, hand)
        add_wrench_sensors(spec, TIPS)  # first: `contact_wrenches` counts from the start
        for tip in TIPS:
            add_body_sensors(spec, tip, name=tip)
        for side in SIDES:
            add_body_sensors(spec, f"{side}_hand mount", name=f"{side}_base")
        if self.table:
            _add_table(spec, self.table)
        for name, placed in self.things.items():
            _add_thing(spec, name, placed)
            add_body_sensors(spec, name, name=name)
        for site in spec.sites:
            add_site_sensors(spec, site.name)
        return spec

    def _add_hand(self, spec: mujoco.MjSpec, side: str, hand: Pose) -> None:
        mount = add_shadow_hand(spec, f"{side}_", pos=hand.pos, quat=quaternion(*hand.euler))
        for site in mount.find_all("site"):  # they are for touch sensors of the wheel's scenes
            spec.delete(site)
        if self.hands_move:
            _unfix(mount, side)
        if self.hands_touch:
            for geom in (geom for geom in mount.find_all("geom") if geom.contype):
                geom.contype |= _OTHER_HAND if side == "left" else 0
                geom.conaffinity |= _OTHER_HAND if side == "right" else 0
        spec.body(f"{side}_palm").add_site(name=f"{side}_hand", pos=PALM_POINT)
        for finger, tip in zip(FINGERS, FINGERTIPS, strict=True):
            spec.body(f"{side}_{tip}").add_site(name=f"{side}_hand_{finger}", pos=[0, 0, 0.02])


def _unfix(mount: mujoco.MjsBody, side: str) -> None:
    """Let a hand move, and turn about the point where forces push it, both against drag.

    The original damps every link. If drag acted on the mount instead, it would turn a hand that is pushed.
    """
    for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        mount.add_joint(
            name=f"{side}_base_{'xyz'[axis.index(1)]}",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=axis,
            damping=[_DRAG * _MASS, 0, 0],
        )
    mount.add_joint(
        name=f"{side}_base_turn", type=mujoco.mjtJoint.mjJNT_BALL, pos=_CENTRE, damping=[_DRAG * _INERTIA, 0, 0]
    )


def _add_table(spec: mujoco.MjSpec, table: Table) -> None:
    half = [size / 2 for size in table.size]
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[*table.centre, half[2]],
        size=half,
        friction=[table.friction, 0.005, 0.0001],
        priority=2 * int(table.friction != 1.0),
        rgba=[0.6, 0.5, 0.4, 1],
        **MATTER,
    )


def _add_thing(spec: mujoco.MjSpec, name: str, placed: Placed) -> None:
    body = spec.worldbody.add_body(name=name, pos=placed.pos, quat=quaternion(*placed.euler))
    placed.thing.build(body)
    for point, pos in placed.points.items():
        body.add_site(name=point, pos=pos)
    for point, pos in placed.link_points.items():
        body.add_site(name=point, pos=pos, quat=LINK)
    if not placed.fixed:
        body.add_freejoint(name=name)
        return
    for part in body.bodies:  # MuJoCo lets a part collide with its parent if that is fixed to the world
        spec.add_exclude(bodyname1=name, bodyname2=part.name)
