"""The inputs that a draft's actions of -1 and 1 give each actuator."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from ..tasks.anatomy import HINGE, ON_JOINTS, SLIDE

_FIXED, _AFFINE, _NO_BIAS = (
    int(mujoco.mjtGain.mjGAIN_FIXED),
    int(mujoco.mjtBias.mjBIAS_AFFINE),
    int(mujoco.mjtBias.mjBIAS_NONE),
)
_DIRECT = tuple(int(getattr(mujoco.mjtDyn, f"mjDYN_{name}")) for name in ("NONE", "FILTER", "FILTEREXACT"))
"""Kinds of actuators whose state, if they have one, follows their input."""
_MUSCLE = int(mujoco.mjtDyn.mjDYN_MUSCLE)


class Control(NamedTuple):
    """The inputs of an actuator for actions of -1 and 1."""

    low: float
    high: float
    guessed: bool = False
    """Whether this is a guess, as the model gives no range."""


def controls(model: mujoco.MjModel) -> list[Control]:
    """For each actuator its own range, else that which its joint's range or its largest force implies, else -1 to 1."""
    return [_control(model, actuator) for actuator in range(model.nu)]


def _control(model: mujoco.MjModel, actuator: int) -> Control:
    if model.actuator_ctrllimited[actuator] and np.isfinite(model.actuator_ctrlrange[actuator]).all():
        low, high = model.actuator_ctrlrange[actuator].tolist()
        return Control(low, high)
    if model.actuator_dyntype[actuator] == _MUSCLE:
        return Control(0.0, 1.0)  # MuJoCo clips a muscle's excitation to this
    if not _is_direct(model, actuator):
        return Control(-1.0, 1.0, guessed=True)
    joint = driven_joint(model, actuator)
    gear, gain = float(model.actuator_gear[actuator, 0]), float(model.actuator_gainprm[actuator, 0])
    if _is_servo(model, actuator) and is_bounded(model, joint):
        low, high = sorted((gear * model.jnt_range[joint]).tolist())  # a servo compares its input to gear * joint
        return Control(low, high)
    if model.actuator_biastype[actuator] != _NO_BIAS or not gain:
        return Control(-1.0, 1.0, guessed=True)
    bounds = [model.actuator_forcerange[actuator] / gain] if model.actuator_forcelimited[actuator] else []
    if joint >= 0 and gear and model.jnt_actfrclimited[joint]:
        bounds.append(model.jnt_actfrcrange[joint] / (gain * gear))
    if not bounds or not np.isfinite(bounds).all():
        return Control(-1.0, 1.0, guessed=True)
    return Control(float(max(map(min, bounds))), float(min(map(max, bounds))))


def servo_range(model: mujoco.MjModel, actuator: int) -> tuple[int, np.ndarray] | None:
    """The joint that a position servo moves, and the range (2,) of positions it can ask for; None for other kinds."""
    joint, gear = driven_joint(model, actuator), float(model.actuator_gear[actuator, 0])
    if joint < 0 or not gear or not _is_servo(model, actuator):
        return None
    return joint, np.sort(np.array(_control(model, actuator)[:2]) / gear)


def driven_joint(model: mujoco.MjModel, actuator: int) -> int:
    """The hinge or slide that an actuator acts on directly; -1 for none."""
    joint = int(model.actuator_trnid[actuator, 0])
    alone = model.actuator_trntype[actuator] in ON_JOINTS
    return joint if alone and model.jnt_type[joint] in (SLIDE, HINGE) else -1


def is_bounded(model: mujoco.MjModel, joint: int) -> bool:
    """Whether a hinge or slide has a range; -1 is no joint."""
    return joint >= 0 and bool(model.jnt_limited[joint]) and bool(np.isfinite(model.jnt_range[joint]).all())


def _is_direct(model: mujoco.MjModel, actuator: int) -> bool:
    return model.actuator_gaintype[actuator] == _FIXED and model.actuator_dyntype[actuator] in _DIRECT


def _is_servo(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether its force is zero where the joint has the position that the input asks for."""
    gain, pull = model.actuator_gainprm[actuator, 0], model.actuator_biasprm[actuator, 1]
    affine = model.actuator_biastype[actuator] == _AFFINE and _is_direct(model, actuator)
    return bool(affine and gain > 0.0 and np.isclose(gain, -pull))
