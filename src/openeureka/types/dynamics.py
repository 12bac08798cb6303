"""How a world may differ from the model of its task, and the ranges that worlds of training are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

from .bounds import Finite


@dataclass(frozen=True, slots=True, kw_only=True)
class Dynamics:
    """The physics of one world. The defaults are the task as it is; a factor multiplies the model's own value."""

    mass: Finite = 1.0
    """Factor on every body's mass and inertia, as if the material were denser."""
    inertia: Finite = 1.0
    """Factor on every body's inertia alone, on top of that of `mass`."""
    friction: Finite = 1.0
    """Factor on every contact's friction."""
    strength: Finite = 1.0
    """Factor on the force or torque of every drive, its limit included."""
    stiffness: Finite = 1.0
    """Factor on the proportional gain of every position drive."""
    drive_damping: Finite = 1.0
    """Factor on the velocity gain of every position drive."""
    joint_damping: Finite = 1.0
    """Factor on the linear damping of every joint."""
    armature: Finite = 1.0
    """Factor on the rotor inertia of every joint."""
    gravity: Finite = 1.0
    """Factor on gravity."""
    delay: Finite = 0.0
    """[s] until an action takes effect, rounded to whole control steps."""
    noise: Finite = 0.0
    """Largest error of each observation on each step, in the units that the policy observes in."""
    push: Finite = 0.0
    """[m/s] that a push on the floating base adds to the horizontal velocity of the whole robot's centre of mass,
    within one control step."""
    push_every: Finite = 10.0
    """[s] from one push to the next, on average."""


NOMINAL = Dynamics()
"""The task's own world."""
QUANTITIES = tuple(field.name for field in fields(Dynamics))


class Scale(NamedTuple):
    """The unit of a quantity, and its least and largest sensible value."""

    unit: str
    least: float
    most: float


_FACTOR = Scale("factor", 0.01, 100.0)
SCALES: Mapping[str, Scale] = {
    **dict.fromkeys(QUANTITIES, _FACTOR),
    "friction": Scale("factor", 0.0, 100.0),
    "drive_damping": Scale("factor", 0.0, 100.0),
    "joint_damping": Scale("factor", 0.0, 100.0),
    "gravity": Scale("factor", 0.0, 10.0),
    "delay": Scale("s", 0.0, 1.0),
    "noise": Scale("units of the observation", 0.0, 100.0),
    "push": Scale("m/s", 0.0, 20.0),
    "push_every": Scale("s", 0.1, 1000.0),
}


@dataclass(frozen=True, slots=True)
class Ranges:
    """Each world draws each quantity uniformly between `low` and `high`, anew for every episode."""

    low: Dynamics
    high: Dynamics

    @property
    def drawn(self) -> dict[str, tuple[float, float]]:
        """Low and high end of each quantity, except those that always have the value of the task's own world."""
        ends = {name: (getattr(self.low, name), getattr(self.high, name)) for name in QUANTITIES}
        return {name: pair for name, pair in ends.items() if set(pair) != {getattr(NOMINAL, name)}}

    def __str__(self) -> str:
        return ", ".join(f"{name} {low:g} to {high:g} {SCALES[name].unit}" for name, (low, high) in self.drawn.items())
