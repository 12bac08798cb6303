"""A pen turned in one Shadow Hand: two tasks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import mujoco
import torch
from torch import Tensor

from ...tasks.rotations import multiply, turn_about
from ...tasks.sensors import add_wrench_sensors
from ...tasks.task import Stage
from ...types import StateSpec
from ..assets import REWARDS
from ..isaac.reorientation import GOAL, OBJECT, Vector, add_marker
from ..isaac.shadow_hand import PREFIX, TIPS, ShadowHand, shadow_hand_variables
from ..shadow import add_shadow_hand

RADIUS, HALF_LENGTH = 0.008, 0.1  # [m] of the pen: a capsule along its z axis, 0.216 m long
DENSITY = 1000.0  # [kg/m3]
TILT = 0.3  # [rad] of the start pose, out of the horizontal, either way

TURN = math.radians(30)
"""[rad] from one waypoint to the next, about the pen's own y axis."""
CYCLE = 12
"""Waypoints of one turn of the pen."""
FIRST_WAYPOINT = -2.0 * math.atan(0.8)
"""[rad] about x: the direction of the published quaternion (-0.8, 0, 0, 1), which is not of unit length."""


class PenInHand(ShadowHand):
    """A Shadow Hand and a pen, whose goals are random orientations or the waypoints of a spin in the palm's plane.

    Waypoints follow each other without an end; an episode begins with any of them. One cycle is 12 goals.
    """

    suite = "dexterity"
    human = REWARDS / "pen_in_hand.py"
    random_goals: ClassVar[bool]
    """Whether goals are random orientations; otherwise waypoints."""
    distance_weight: ClassVar[float]
    """[1/m] Weight of the distance from the goal in the human reward."""

    tolerance = 0.0
    """[rad] 0 stands for that of the published goals."""

    def __init__(self, *args) -> None:
        super().__init__(*args)
        # As hard to reach as in the original, which takes 0.2 rad between two quaternions, one of them 1.28 long.
        waypoint = 2.0 * math.asin(math.sin(0.1) * math.cos(FIRST_WAYPOINT / 2))
        self.tolerance = self.tolerance or (0.2 if self.random_goals else waypoint)
        self.first_waypoint = turn_about(0, torch.tensor(FIRST_WAYPOINT, device=self.device))
        self.turn = turn_about(1, torch.tensor(TURN, device=self.device))

    def start_rotation(self, worlds: Tensor) -> Tensor:
        """Along the forearm, tilted by at most 0.3 rad, and rolled about its own axis by an angle tied to the tilt."""
        u = self.noise.uniform(worlds, 1, -1.0, 1.0)[:, 0]
        return multiply(turn_about(0, 0.5 * math.pi + TILT * u), turn_about(2, math.pi * u))

    def first_goal(self, worlds: Tensor) -> Tensor:
        if self.random_goals:
            return super().first_goal(worlds)
        number = self.noise.uniform(worlds, 1, 0.0, CYCLE)[:, 0].floor()
        return multiply(self.first_waypoint, turn_about(1, TURN * number))

    def next_goal(self) -> Tensor:
        return super().next_goal() if self.random_goals else multiply(self.goal_rot, self.turn)


def pen_scene(hand: Sequence[float], start: Vector, goal: Vector) -> mujoco.MjSpec:
    """The hand, its mount 0.5 m high and turned by `hand` (w x y z), the pen, and a picture of the pen's goal."""
    spec = mujoco.MjSpec()
    add_shadow_hand(spec, PREFIX, pos=[0, 0, 0.5], quat=hand)
    spec.worldbody.add_light(pos=[0, 0, 5])
    pen = spec.worldbody.add_body(name=OBJECT, pos=start)
    # The original damps rotation by 0.5 1/s. Left out, as MuJoCo's one coefficient would damp roll 100 times more than
    # spin.
    pen.add_freejoint(name=OBJECT)
    add_pen(pen, OBJECT, density=DENSITY, contype=0, conaffinity=1)
    add_pen(add_marker(spec, goal), GOAL, mass=0, contype=0, conaffinity=0)
    add_wrench_sensors(spec, TIPS)
    return spec


def add_pen(body: mujoco.MjsBody, name: str, **common: float) -> None:
    """The capsule; its tip, at +z, is red so that videos show which way it points."""
    size = [RADIUS, HALF_LENGTH, 0]
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=size, rgba=[0.2, 0.3, 0.6, 1], **common)
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[1.05 * RADIUS, 0.1 * HALF_LENGTH, 0],
        pos=[0, 0, 0.9 * HALF_LENGTH],
        rgba=[0.8, 0.1, 0.1, 1],
        mass=0,
        contype=0,
        conaffinity=0,
    )


class ShadowHandSpin(PenInHand):
    """A pen spun in the palm, from waypoint to waypoint; Eureka's demonstration."""

    env = "shadow_hand_spin"
    description = "to make the shadow hand spin the object to a target orientation"
    random_goals = False
    distance_weight = 0.1  # its sign is the published one
    object_start = (0.0, -0.39, 0.59)  # the original starts 7 cm lower, with the pen up to 2 cm inside palm and fingers
    goal_position = (0.0, -0.39, 0.48)
    spec = StateSpec(shadow_hand_variables("pen", "2 cm below the surface of the palm, which faces up"))
    curricula: ClassVar[Mapping[str, tuple[Stage, ...]]] = {
        "pen_spinning": (Stage(set={"random_goals": True}), Stage())
    }

    @staticmethod
    def model() -> mujoco.MjSpec:
        return pen_scene([1, 0, 0, 0], ShadowHandSpin.object_start, ShadowHandSpin.goal_position)


class ShadowHandUpsideDown(PenInHand):
    """A pen turned to random orientations below a hand whose palm faces down."""

    env = "shadow_hand_upside_down"
    description = "to make the shadow hand spin the object to a target orientation"
    random_goals = True
    distance_weight = -10.0
    object_start = (0.0, -0.39, 0.41)  # the original starts 7 cm higher, with the pen up to 2 cm inside the fingers
    goal_position = (0.0, -0.39, 0.44)
    spec = StateSpec(shadow_hand_variables("pen", "6 cm below the palm, which faces down"))

    @staticmethod
    def model() -> mujoco.MjSpec:
        half_a_turn_about_y = [0, 0, 1, 0]
        return pen_scene(half_a_turn_about_y, ShadowHandUpsideDown.object_start, ShadowHandUpsideDown.goal_position)
