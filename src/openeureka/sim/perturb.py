"""Worlds whose models differ: factors on fields of MjModel, world by world."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from operator import attrgetter

import mujoco
import numpy as np
import torch
from torch import Tensor

from .base import Simulator, aligned

Masks = dict[str, np.ndarray]
"""By field of MjModel, a mask of the entries that a factor scales."""
FACTORS = (
    "mass", "inertia", "friction", "strength", "stiffness", "drive_damping",
    "joint_damping", "armature", "gravity",
)  # fmt: skip
"""Factors by which the models of worlds can differ; `types.Dynamics` says what they mean."""


def scaled(model: mujoco.MjModel, factor: str) -> Masks:
    """The entries that a factor scales; all masks are False where it would change nothing."""
    whole = {
        "mass": ("body_mass", "body_inertia"),
        "inertia": ("body_inertia",),
        "joint_damping": ("dof_damping",),
        "armature": ("dof_armature",),
        "gravity": ("opt.gravity",),
    }
    if factor in whole:
        return {field: attrgetter(field)(model) != 0 for field in whole[factor]}
    if factor == "friction":
        touches = (model.geom_contype | model.geom_conaffinity) != 0
        found = {"geom_friction": np.repeat(touches[:, None], 3, axis=1)}
        return found | ({"pair_friction": np.ones_like(model.pair_friction, dtype=bool)} if model.npair else {})
    # A drive's force is gain * control + bias. A motor's bias is 0. For a position drive, gain and -bias[1] are kp and
    # -bias[2] is kv; for a velocity drive, gain and -bias[2] are kv. A muscle's parameters mean other things.
    gain, bias = (np.zeros_like(field, dtype=bool) for field in (model.actuator_gainprm, model.actuator_biasprm))
    fixed = model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_FIXED)
    affine = model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_AFFINE)
    position, damped = (fixed & affine & (model.actuator_biasprm[:, number] != 0) for number in (1, 2))
    if factor == "strength":
        gain[fixed, 0] = True
        gain[model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_AFFINE), :3] = True
        bias[affine, :3] = True
        for muscle in np.flatnonzero(model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_MUSCLE)).tolist():
            gain[muscle, peak(model, muscle)] = bias[muscle, peak(model, muscle)] = True
        limits = {
            "actuator_forcerange": model.actuator_forcelimited != 0,
            "jnt_actfrcrange": model.jnt_actfrclimited != 0,
            "tendon_actfrcrange": model.tendon_actfrclimited != 0,
        }
        found = {field: np.repeat(own[:, None], 2, axis=1) for field, own in limits.items() if own.any()}
        return {"actuator_gainprm": gain, "actuator_biasprm": bias, **found}
    gain[:, 0], bias[:, 1], bias[:, 2] = {
        "stiffness": (position, position, False),
        "drive_damping": (~position & damped, False, damped),
    }[factor]
    return {"actuator_gainprm": gain, "actuator_biasprm": bias}


def peak(model: mujoco.MjModel, muscle: int) -> int:
    """Which of a muscle's parameters its force is proportional to: `force`, or `scale` where `force` is not given."""
    return 2 if model.actuator_gainprm[muscle, 2] >= 0.0 else 3


def acts(model: mujoco.MjModel, factor: str) -> bool:
    """Whether a factor changes anything of a model."""
    return any(mask.any() for mask in scaled(model, factor).values())


class Perturbed:
    """Scales the models of a simulator's worlds. Fields that no factor scales stay shared by all worlds.

    Args:
        factors: those that `write` will set.
    """

    def __init__(self, sim: Simulator, factors: Collection[str]) -> None:
        self._masks: dict[str, dict[str, Tensor]] = {}
        for factor in factors:
            for field, mask in scaled(sim.model, factor).items():
                self._masks.setdefault(field, {})[factor] = torch.as_tensor(mask, device=sim.device)
        self._fields = {field: sim.expand(field) for field in self._masks}
        self._own = {field: values.clone() for field, values in self._fields.items()}

    def write(self, factors: Mapping[str, Tensor], worlds: Tensor) -> None:
        """Scale the models of the worlds (N,) bool by factors (N,); a `forward` of them must follow."""
        for field, values in self._fields.items():
            new = self._own[field]
            for factor, mask in self._masks[field].items():
                new = torch.where(mask, new * aligned(factors[factor], new), new)
            values.copy_(torch.where(aligned(worlds, values), new, values))
