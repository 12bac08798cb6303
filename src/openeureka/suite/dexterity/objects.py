"""What the two hands handle, built from primitives in the original sizes.

Each object is a frozen description that knows how to fill a body, whose frame is the object's base frame (z up). It
adds sites for points on its moving parts; points that are fixed to the base frame are given where it is placed.
Masses are in kg; friction is that of a contact with a hand, the average of both materials as in PhysX.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Protocol

import mujoco

from ..angles import quaternion
from .shapes import (
    EGGSHELL,
    LINK,
    MATTER,
    METAL,
    PLASTIC,
    Vector,
    add_box,
    add_cylinder,
    add_hinge,
    add_loop,
    add_rod,
    add_slide,
    set_inertia,
)


class Thing(Protocol):
    """An object without a place."""

    bodies: ClassVar[int]
    """Bodies in the original: an empty base, the main body and its moving parts; 1 for an object of one piece."""

    def build(self, body: mujoco.MjsBody) -> None:
        """Add geoms, moving parts and sites to an empty body."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Egg:
    mass: float = 0.0754
    semi_axes: Vector = (0.03, 0.03, 0.04)
    bodies: ClassVar[int] = 1

    def build(self, body: mujoco.MjsBody) -> None:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=self.semi_axes, mass=self.mass, rgba=EGGSHELL, **MATTER
        )


CUBE_START: Vector = (math.pi / 2, math.pi / 2, 0)
"""How the original turns cubes that start on a table [rad]; a cube looks the same after these turns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cube:
    mass: float = 0.0709
    """At the 567 kg/m3 of the original's file."""
    friction: float = 1.0
    edge: float = 0.05
    bodies: ClassVar[int] = 1

    def build(self, body: mujoco.MjsBody) -> None:
        half = self.edge / 2
        add_box(body, (-half, -half, -half), (half, half, half), mass=self.mass, friction=self.friction)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pot:
    """Two bar handles towards +y and -y; the lid slides up. Its inertia is far larger than its shape implies."""

    mass: float = 3.0
    lid_mass: float = 1.0
    inertia: Vector = (0.4, 0.4, 0.2)
    """Inertia of the body and of the lid, each [kg m2]."""
    friction: float = 2.0
    bodies: ClassVar[int] = 3

    def build(self, body: mujoco.MjsBody) -> None:
        set_inertia(body, self.mass, self.inertia)
        axis = (-0.005, 0.001)
        add_cylinder(body, (*axis, -0.065), (*axis, 0.050), 0.118, friction=self.friction)
        add_cylinder(body, (*axis, 0.050), (*axis, 0.061), 0.122)
        for side in (1, -1):
            for x in (0.025 * side, -0.033 * side):
                inner, outer = sorted((0.114 * side, 0.175 * side))
                add_box(body, (x - 0.0035, inner, 0.015), (x + 0.0035, outer, 0.066))
            middle = -0.004 * side
            add_rod(body, (middle - 0.051, 0.1755 * side, 0.063), (middle + 0.051, 0.1755 * side, 0.063), 0.0055)
        lid = body.add_body(name="pot_lid")
        set_inertia(lid, self.lid_mass, self.inertia)
        add_slide(lid, "pot_lid", (0, 0, 1), (0, 0.06))
        add_cylinder(lid, (*axis, 0.052), (*axis, 0.061), 0.117)
        add_rod(lid, (axis[0], -0.051, 0.096), (axis[0], 0.051, 0.096), 0.0055)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubleDoor:
    """Two leaves that meet at y = 0 and swing towards -x, with a vertical handle on each face.

    The joints `door_right_hinge` and `door_left_hinge` are 0 when closed; the sites `door_right_handle` and
    `door_left_handle` are the points to grasp, in the orientation of the original's links.
    """

    hands_at: int
    """Face that the hands are at and the sites on: 1 for +x, -1 for -x."""
    spring_angle: float = 0.0
    """Where the hinges' spring is at rest [rad]."""
    stiffness: float = 5.0
    """[N m/rad]; 0 for doors without a spring."""
    damping: float = 1.0
    leaf_mass: float = 3.6
    handle_mass: float = 0.33
    friction: float = 0.55
    bodies: ClassVar[int] = 4

    def build(self, body: mujoco.MjsBody) -> None:
        for z in (-0.444, 0.481):
            add_box(body, (-0.0022, -0.88, z - 0.0022), (0.0022, 0.88, z + 0.0022), friction=self.friction)
        self._add_leaf(
            body, "right", side=1, hinge=(-0.008462, 0.426527, 0.483292), edges=(0.007, 0.4475), handle=(0.034, 0.070)
        )
        self._add_leaf(
            body,
            "left",
            side=-1,
            hinge=(-0.005600, -0.420407, 0.483292),
            edges=(-0.4436, -0.003),
            handle=(-0.062, -0.026),
        )

    def _add_leaf(
        self,
        frame: mujoco.MjsBody,
        name: str,
        *,
        side: int,
        hinge: Vector,
        edges: tuple[float, float],
        handle: tuple[float, float],
    ) -> None:
        leaf = frame.add_body(name=f"door_{name}_leaf")
        add_hinge(
            leaf,
            f"door_{name}_hinge",
            (0, 0, -side),
            (0, math.pi / 2),
            pos=hinge,
            stiffness=self.stiffness,
            springref=self.spring_angle,
            damping=self.damping,
        )
        add_box(leaf, (-0.010, edges[0], -0.444), (0.007, edges[1], 0.481), mass=self.leaf_mass, friction=self.friction)
        for surface, reach in ((-0.010, -0.091), (0.007, 0.085)):
            y, width = sum(handle) / 2, handle[1] - handle[0]
            add_loop(
                leaf, surface, reach, (-0.193, 0.107), y=y, width=width, mass=self.handle_mass, friction=self.friction
            )
        point = (hinge[0] + 0.04 * self.hands_at, hinge[1] - 0.39 * side, hinge[2] - 0.5)
        leaf.add_site(name=f"door_{name}_handle", pos=point, quat=LINK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bottle:
    """The cap slides up (`bottle_cap_slide`) and turns (`bottle_cap_turn`); the site `bottle_cap_up` moves with it."""

    mass: float = 0.35
    cap_mass: float = 0.0026
    stiffness: float = 5.0
    """Stiffness of the slide [N/m] and of the turn [N m/rad]: the original gives both joints the same numbers."""
    damping: float = 1.0
    """[N s/m] and [N m s/rad]"""
    friction: float = 5.0
    """The original's is 50; both hold the bottle like glue."""
    bodies: ClassVar[int] = 4

    def build(self, body: mujoco.MjsBody) -> None:
        axis = (-0.001, -0.001)
        add_cylinder(body, (*axis, -0.026), (*axis, 0.106), 0.0375, mass=0.95 * self.mass, friction=self.friction)
        add_cylinder(body, (*axis, 0.106), (*axis, 0.134), 0.024, mass=0.04 * self.mass, friction=self.friction)
        add_cylinder(body, (*axis, 0.134), (*axis, 0.149), 0.011, mass=0.01 * self.mass, friction=self.friction)
        cap = body.add_body(name="bottle_cap")
        pivot = (-0.007542, -0.007006, 0)
        add_slide(cap, "bottle_cap_slide", (0, 0, 1), (0, 0.064), stiffness=self.stiffness, damping=self.damping)
        cap.add_joint(
            name="bottle_cap_turn",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 0, 1],
            pos=pivot,
            stiffness=[self.stiffness, 0, 0],
            damping=[self.damping, 0, 0],
            armature=1e-5,
        )
        add_cylinder(cap, (*axis, 0.139), (*axis, 0.150), 0.0128, mass=self.cap_mass, friction=self.friction)
        cap.add_site(name="bottle_cap_up", pos=pivot)


@dataclass(frozen=True, slots=True, kw_only=True)
class CappedPen:
    """The cap comes off towards -z by `pen_cap_slide`; the site `pen_right_handle` is on it."""

    mass: float = 0.05
    cap_mass: float = 0.027
    stiffness: float = 1.0
    damping: float = 0.5
    bodies: ClassVar[int] = 3

    def build(self, body: mujoco.MjsBody) -> None:
        add_rod(body, (0.001, 0, -0.1485), (0.001, 0, 0.1895), 0.0105, mass=self.mass)
        cap = body.add_body(name="pen_cap")
        add_slide(cap, "pen_cap_slide", (0, 0, -1), (0, 0.492), stiffness=self.stiffness, damping=self.damping)
        add_cylinder(cap, (0.001, 0, -0.172), (0.001, 0, -0.0405), 0.0115, mass=0.9 * self.cap_mass)
        add_box(cap, (-0.0165, -0.0065, -0.150), (-0.0105, 0.0065, -0.051), mass=0.1 * self.cap_mass)
        cap.add_site(name="pen_right_handle", pos=(0, 0, -0.1), quat=LINK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cup:
    """A loop handle towards +x and -x. Solid, because its lid closes it; the lid slides up."""

    mass: float = 0.55
    lid_mass: float = 0.05
    friction: float = 0.75
    bodies: ClassVar[int] = 3

    def build(self, body: mujoco.MjsBody) -> None:
        axis = (0.006, -0.003)
        for bottom, top, radius, share in (
            (-0.084, -0.058, 0.040, 0.2),
            (-0.058, 0, 0.043, 0.3),
            (0, 0.069, 0.048, 0.4),
        ):
            add_cylinder(body, (*axis, bottom), (*axis, top), radius, mass=share * self.mass, friction=self.friction)
        for side in (1, -1):
            add_loop(
                body,
                0.031 * side,
                0.088 * side,
                (-0.062, 0.059),
                y=-0.01225 * side,
                width=0.0295,
                mass=0.05 * self.mass,
            )
        lid = body.add_body(name="cup_lid")
        add_slide(lid, "cup_lid", (0, 0, 1), (0, 0.108), pos=(0.006226, 0.001301, 0))
        add_cylinder(lid, (*axis, 0.064), (*axis, 0.0745), 0.05, mass=self.lid_mass)


@dataclass(frozen=True, slots=True, kw_only=True)
class Kettle:
    """A loop handle towards +x, a spout towards -x. Solid: the original's water counts for nothing and is left out."""

    mass: float = 1.0
    lid_mass: float = 0.1
    bodies: ClassVar[int] = 3

    def build(self, body: mujoco.MjsBody) -> None:
        for bottom, top, radius, share in (
            (-0.074, -0.05, 0.105, 0.25),
            (-0.05, 0, 0.113, 0.35),
            (0, 0.069, 0.098, 0.3),
        ):
            add_cylinder(body, (0, 0, bottom), (0, 0, top), radius, mass=share * self.mass)
        add_loop(body, 0.084, 0.170, (-0.040, 0.055), y=0, width=0.026, mass=0.05 * self.mass)
        add_rod(body, (-0.098, 0, -0.02), (-0.187, 0, 0.06), 0.018, mass=0.05 * self.mass)
        lid = body.add_body(name="kettle_lid")
        add_slide(lid, "kettle_lid", (0, 0, 1), (0, 0.032))
        add_cylinder(lid, (0, 0, 0.063), (0, 0, 0.105), 0.074, mass=self.lid_mass)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bucket:
    """Open at the top: a floor and a wall of flat staves."""

    mass: float = 0.2
    bottom_radius: float = 0.030
    top_radius: float = 0.057
    bottom: float = -0.053
    top: float = 0.0445
    thickness: float = 0.004
    STAVES: ClassVar = 10
    bodies: ClassVar[int] = 2

    def build(self, body: mujoco.MjsBody) -> None:
        outer = self.bottom_radius + self.thickness
        add_cylinder(body, (0, 0, self.bottom), (0, 0, self.bottom + self.thickness), outer, mass=0.2 * self.mass)
        height, flare = self.top - self.bottom, self.top_radius - self.bottom_radius
        radius = (self.bottom_radius + self.top_radius + self.thickness) / 2
        width = 2 * (self.top_radius + self.thickness) * math.tan(math.pi / self.STAVES)
        for stave in range(self.STAVES):
            angle = 2 * math.pi * stave / self.STAVES
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[self.thickness / 2, width / 2, math.hypot(height, flare) / 2],
                pos=[radius * math.cos(angle), radius * math.sin(angle), (self.top + self.bottom) / 2],
                quat=quaternion(0, math.atan2(flare, height), angle),
                mass=0.8 * self.mass / self.STAVES,
                rgba=PLASTIC,
                **MATTER,
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Scissors:
    """Flat on z = 0, blades towards +y; `scissors_hinge` is -0.59 when closed and 0.4 when wide open.

    The sites `scissors_right_handle` (on the moving half) and `scissors_left_handle` have the orientation of the
    original's links.
    """

    half_mass: float = 0.104
    hinge_friction: float = 0.005
    """[N m] Without it, the scissors open by themselves: lying, they are tilted by 0.01 rad."""
    bodies: ClassVar[int] = 3

    def build(self, body: mujoco.MjsBody) -> None:
        self._add_half(body, ((-0.04, 0), (0.058, 0.304)), (-0.005, 0), ring=(-0.0745, -0.0675), ring_z=-0.002)
        body.add_site(name="scissors_left_handle", pos=(-0.1, -0.15, 0), quat=LINK)
        half = body.add_body(name="scissors_half")
        pivot = (-0.003420, 0.069825, 0)
        add_hinge(
            half,
            "scissors_hinge",
            (0, 0, 1),
            (-0.597, 0.4),
            pos=pivot,
            damping=0.01,
            armature=1e-4,
            friction=self.hinge_friction,
        )
        self._add_half(half, ((0.049, 0), (-0.085, 0.290)), (0, 0.005), ring=(0.0815, -0.069), ring_z=0.002)
        half.add_site(name="scissors_right_handle", pos=(pivot[0] + 0.1, pivot[1] - 0.2, 0), quat=LINK)

    def _add_half(
        self,
        body: mujoco.MjsBody,
        blade: tuple[tuple[float, float], tuple[float, float]],
        blade_z: tuple[float, float],
        *,
        ring: tuple[float, float],
        ring_z: float,
    ) -> None:
        (x0, y0), (x1, y1) = blade
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.0125, math.hypot(x1 - x0, y1 - y0) / 2, (blade_z[1] - blade_z[0]) / 2],
            pos=[(x0 + x1) / 2, (y0 + y1) / 2, sum(blade_z) / 2],
            quat=quaternion(0, 0, math.atan2(x0 - x1, y1 - y0)),
            mass=0.5 * self.half_mass,
            rgba=METAL,
            **MATTER,
        )
        wide, long, sides = 0.052, 0.105, 8
        turns = [2 * math.pi * side / sides for side in range(sides + 1)]
        corners = [(ring[0] + wide * math.cos(turn), ring[1] + long * math.sin(turn), ring_z) for turn in turns]
        for start, end in pairwise(corners):
            add_rod(body, start, end, 0.006, mass=0.5 * self.half_mass / sides)


@dataclass(frozen=True, slots=True, kw_only=True)
class RockerSwitch:
    """A box with a plate on its -x face that rocks about y: `switch_{side}_rocker`, 0 to 0.5585 rad.

    The site `switch_{side}_handle`, to press, has the orientation of the original's link.
    """

    side: str
    """`right` or `left`."""
    rocker_mass: float = 0.042
    bodies: ClassVar[int] = 3

    def build(self, body: mujoco.MjsBody) -> None:
        add_box(body, (-0.043, -0.05, -0.0725), (0.060, 0.05, 0.0725))
        rocker = body.add_body(name=f"switch_{self.side}_rocker")
        pivot = (-0.041670, -0.050228, -0.010859)
        add_hinge(rocker, f"switch_{self.side}_rocker", (0, 1, 0), (0, 0.5585), pos=pivot, damping=0.002, armature=1e-5)
        rocker.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.003, 0.030, 0.051],
            pos=[-0.0503, 0, -0.0015],
            quat=quaternion(0, -0.19, 0),
            mass=self.rocker_mass,
            rgba=PLASTIC,
            **MATTER,
        )
        rocker.add_site(name=f"switch_{self.side}_handle", pos=(pivot[0], pivot[1] + 0.05, pivot[2] - 0.02), quat=LINK)
