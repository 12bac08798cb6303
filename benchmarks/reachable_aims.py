"""What `reachable.py` searches for: for each task, how near a state is to success, and a first plan written by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from openeureka.suite.dexterity.bottle_cap import OFF
from openeureka.suite.dexterity.common import distance
from openeureka.tasks.task import State

Measure = Callable[[Any, State], Tensor]
"""A function of a task and its state (N worlds) that gives (N,)."""

_NAMES = "WRJ1 WRJ0 FFJ3 FFJ2 FFJ1 MFJ3 MFJ2 MFJ1 RFJ3 RFJ2 RFJ1 LFJ4 LFJ3 LFJ2 LFJ1 THJ4 THJ3 THJ2 THJ1 THJ0"
DRIVES = _NAMES.split()
BEND = (0.0, math.pi / 2)
LIMITS = {
    **{"WRJ1": (-0.489, 0.140), "WRJ0": (-0.698, 0.489), "LFJ4": (0.0, 0.785)},
    **{f"{finger}J3": (-0.349, 0.349) for finger in ("FF", "MF", "RF", "LF")},
    **{f"{finger}J{joint}": BEND for finger in ("FF", "MF", "RF", "LF") for joint in (1, 2)},
    **{"THJ4": (-1.047, 1.047), "THJ3": (0.0, 1.222), "THJ2": (-0.209, 0.209), "THJ1": (-0.524, 0.524)},
    "THJ0": (-math.pi / 2, 0.0),
}
"""[rad]"""


def fingers(knuckles: float = 0.0, middle: float = 0.0, **joints: float) -> list[float]:
    """Actions (20,) that hold joints at angles [rad]; those not named are straight.

    Args:
        knuckles: angle of the four fingers' J2.
        middle: angle of their J1, which J0 follows.
    """
    angles = dict.fromkeys(DRIVES, 0.0)
    for finger in ("FF", "MF", "RF", "LF"):
        angles |= {f"{finger}J2": knuckles, f"{finger}J1": middle}
    angles |= joints
    return [2 * (angles[name] - LIMITS[name][0]) / (LIMITS[name][1] - LIMITS[name][0]) - 1 for name in DRIVES]


def hand(
    push: Sequence[float] = (0, 0, 0), turn: Sequence[float] = (0, 0, 0), pose: Sequence[float] = ()
) -> list[float]:
    """Actions (26,) of one hand: force and torque along the world's axes as shares of the greatest, and the joints."""
    return [*push, *turn, *(pose or fingers())]


def held(*stages: tuple[int, Sequence[float], Sequence[float]]) -> list[list[float]]:
    """A plan of stages: number of knots, actions of the right hand, actions of the left."""
    return [[*right, *left] for knots, right, left in stages for _ in range(knots)]


@dataclass(frozen=True, kw_only=True)
class Aim:
    env: str
    progress: Measure
    """Grows towards success, by about 1 from start to end."""
    guess: Sequence[Sequence[float]]
    """Actions, each held for an equal part of the episode."""
    how: str
    """What the plan does, in words."""
    spread: float = 0.15
    """Standard deviation of the first actions tried around the guess; the greatest action is 1."""
    steps: int = 0
    """Steps of the plan, where it is shorter than an episode."""
    like: str = ""
    """A task with the same right hand: both hands begin with what was found for it, the left one turned half around."""
    moves: tuple[int, int] = (0, 52)
    """The actions that are searched."""
    success: Measure = lambda task, s: task.success(s)


# Both hands are right hands, the left one with its thumb down: to mirror a push does not mirror the fingers.
HOOK = fingers(0.4, 1.5, THJ4=0.5, THJ3=1.0)
FLAT = fingers()
AROUND_BOTTLE = [
    1.0, 0.41, 0.82, 0.88, 0.15, 0.71, -0.21, 0.71, 0.24, -0.1,
    0.4, -0.33, 0.31, 0.17, 0.63, 0.28, 0.54, 0.33, -0.15, -1.0,
]  # fmt: skip
DOWN = fingers(1.3)
WIDE = fingers(THJ4=-1.0)
GRASP = fingers(1.0, 1.3, THJ4=-0.3, THJ3=1.1, THJ1=0.5, THJ0=-1.0)
GRIP = fingers(0.5, 1.57, WRJ0=0.4)


def _gap(task: Any, s: State) -> Tensor:
    return task.handle_gap(s)


def _narrowing(task: Any, s: State) -> Tensor:
    return 1.0 - task.handle_gap(s)


def _stacked(task: Any, s: State) -> Tensor:
    """1 less what is missing, beyond what is allowed, of both cubes' places and the upper one's height [0.1 m]."""
    lower, upper = task._errors(s)
    missing = (lower - 0.06).clamp(min=0) + (upper - 0.06).clamp(min=0) + (task._height_error(s) - 0.02).clamp(min=0)
    return 1.0 - missing / 0.1


def _nearest_finger(s: State, side: str, point: Tensor) -> Tensor:
    tips = [distance(s[f"{side}_hand_{finger}_pos"], point) for finger in ("ff", "mf", "rf", "lf", "th")]
    return torch.stack(tips).amin(dim=0)


def both(push: tuple[float, float, float], pose: Sequence[float], turn: tuple[float, float, float] = (0, 0, 0)):
    """The right hand's actions and the left one's, mirrored in y."""
    x, y, z = push
    return hand(push, turn, pose), hand((x, -y, z), (-turn[0], turn[1], -turn[2]), pose)


AIMS = (
    Aim(
        env="shadow_hand_door_open_inward",
        progress=_gap,
        guess=held(
            (3, *both((-0.6, -0.9, 0), FLAT)),
            (2, *both((0, 0, 0), HOOK)),
            (4, *both((0.8, 0.2, 0), HOOK)),
            (6, *both((0.7, 0.35, 0), HOOK, turn=(0, 0, 0.9))),
            (10, *both((0.35, 0.6, 0), HOOK, turn=(0, 0, 1))),
        ),
        how="fingers behind the handles, hooked, bases pull",
    ),
    Aim(
        env="shadow_hand_door_close_inward",
        progress=_narrowing,
        guess=held((2, *both((-1, 0, 0), FLAT)), (8, *both((0, -1, 0), FLAT)), (15, *both((-0.5, -1, 0), FLAT))),
        how="bases bring the palms beside the leaves' outer faces and push",
    ),
    Aim(
        env="shadow_hand_door_close_outward",
        progress=_narrowing,
        guess=held((8, *both((0, 1, 0), FLAT)), (11, *both((-1, 0, 0), FLAT)), (16, *both((-0.3, -1, 0), FLAT))),
        how="bases reach around the frame and push the leaves' outer faces",
    ),
    Aim(
        env="shadow_hand_lift_underarm",
        progress=lambda task, s: (s["object_pos"][:, 2] - 0.45) / 0.4,
        guess=held(
            (2, *both((0, -0.25, 0), FLAT)),
            (2, *both((0, 0, 0.7), FLAT)),
            (1, *both((0, 0, 0.2), GRIP)),
            (15, *both((0, 0, 1), GRIP, turn=(-1, 0, 0))),
        ),
        how="fingers under the bars, bases lift",
    ),
    Aim(
        env="shadow_hand_kettle",
        progress=lambda task, s: -task._apart(s) / 0.2,
        guess=held(
            (9, hand(), hand((-0.6, -1, 0), pose=WIDE)),
            (6, hand(), hand((-0.3, 0, -1), pose=WIDE)),
            (4, hand(), hand((0, 0.5, 0), pose=GRASP)),
            (11, hand(), hand((0, 0.2, 1), pose=GRASP)),
        ),
        moves=(26, 52),
        how="the left hand grasps the bucket and lifts it over the spout",
    ),
    Aim(
        env="shadow_hand_catch_underarm",
        progress=lambda task, s: -distance(s["object_pos"], s["goal_pos"]) / 0.4,
        guess=held(
            (5, hand((0, 0, 1), (1, 0, 0), fingers(0.2, WRJ0=-0.6)), hand()),
            (10, hand((0, -1, 1), (-1, 0, 0), fingers(0.1, WRJ0=0.48)), hand()),
        ),
        spread=0.4,
        moves=(0, 26),
        how="the egg rolls to the fingers, and the wrist throws",
    ),
    Aim(
        env="shadow_hand_block_stack",
        progress=_stacked,
        guess=held(
            (8, *both((0, -0.8, -0.2), DOWN)),
            (6, *both((0, -0.25, 0.6), DOWN)),
            (6, *both((0, -0.1, 0.3), DOWN)),
        ),
        how="the hands press the cubes together and lift both by 4 cm",
    ),
    Aim(
        env="shadow_hand_bottle_cap",
        progress=lambda task, s: task._lifted(s) / OFF - 5 * _nearest_finger(s, "right", s["bottle_cap_pos"]),
        guess=held(
            (8, hand((-0.9, 0.9, -1), pose=fingers(0.3, 0.3)), hand((0, 0, 0.25), (0, 1, 0), AROUND_BOTTLE)),
            (8, hand((-0.6, 0, -1), pose=fingers(0.8, 0.6)), hand((0, 0, 0.25), (0, 1, 0), AROUND_BOTTLE)),
            (9, hand((-1, 0, 0.8), pose=fingers(0.95, 0.75)), hand((0, 0, 0.25), (0, 1, 0), AROUND_BOTTLE)),
        ),
        spread=0.2,
        how="the left hand holds the bottle, a finger of the right drags the cap along",
    ),
    Aim(
        env="shadow_hand_catch_abreast",
        progress=lambda task, s: -distance(s["object_pos"], s["goal_pos"]) / 0.6,
        guess=held(
            (14, hand(turn=(0, 0, 1), pose=fingers(0.6, 0.6, WRJ0=-0.2)), hand(turn=(0, 0, -1))),
            (3, hand((0, -0.3, 0), pose=fingers(0.2, 0.2, WRJ0=-0.6)), hand()),
            (8, hand((0, -1, 1), (-1, 0, 0), fingers(0.2, 0.3, WRJ0=0.48)), hand()),
        ),
        spread=0.4,
        moves=(0, 26),
        how="the right hand turns towards the left one and throws",
    ),
    Aim(
        env="shadow_hand_upside_down",
        progress=lambda task, s: -s["rotation_distance"],
        guess=[fingers(0.8, 0.8)] * 8,
        spread=0.6,
        moves=(0, 20),
        steps=24,
        how="fingers turn the falling pen",
        success=lambda task, s: task.sparse_reward(s),
    ),
    Aim(
        env="shadow_hand_two_catch_underarm",
        progress=lambda task, s: -sum(task.distances(s)) / 0.8,
        guess=held((5, *[hand(pose=fingers(0.2, WRJ0=-0.6))] * 2), (10, *[hand(pose=fingers(0.1, WRJ0=0.48))] * 2)),
        like="shadow_hand_catch_underarm",
        spread=0.3,
        how="both hands throw",
    ),
)
