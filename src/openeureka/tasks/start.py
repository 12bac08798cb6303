"""How a drafted task's episodes begin: a pose of the model, and how far its joints differ from it."""

from __future__ import annotations

import mujoco
import numpy as np

from .anatomy import base, follow, scalar_joints, tied, upwards

SWAY = 0.05
"""[rad] or [m] by which joints differ from the pose at the start of an episode, at most."""
SHARE = 0.1
"""Share of a joint's range by which it differs, at most."""
_SWAYS = 64
"""Random poses in which a robot is kept out of the ground."""
_MOST_LIFT = 0.1
"""[m] A robot that is deeper in the ground is modelled so, and stays."""


def at_start(model: mujoco.MjModel, field: str) -> np.ndarray:
    """MjData's field in the first keyframe, or else in the model's own pose."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return getattr(data, field).copy()


def home(model: mujoco.MjModel) -> np.ndarray:
    """`qpos` (nq,) of the first keyframe, or else of the model's own pose.

    Joints are moved inside their range, and a robot above the ground, so far that there is room to `sway`.
    """
    pose, room = at_start(model, "qpos"), sway(model)
    for joint in scalar_joints(model):
        place, (low, high) = model.jnt_qposadr[joint], model.jnt_range[joint]
        if model.jnt_limited[joint]:
            pose[place] = min(max(pose[place], low + room[place]), high - room[place])
    follow(model, pose)
    carrier = base(model)
    if carrier is not None and (up := upwards(model, carrier)):
        place, height = up
        pose[place] += _sunk(model, carrier, pose, room) / height
    return pose


def sway(model: mujoco.MjModel) -> np.ndarray:
    """(nq,) by how much each number of `home` may differ, [rad] or [m].

    Only hinges and slides do. Joints that carry a robot through the world do not, nor do joints that an equality
    couples: it would be violated.
    """
    held, carrier, found = tied(model), base(model), np.zeros(model.nq)
    for joint in scalar_joints(model):
        if joint not in held and model.jnt_bodyid[joint] != carrier:
            low, high = model.jnt_range[joint]
            found[model.jnt_qposadr[joint]] = min(SWAY, SHARE * (high - low)) if model.jnt_limited[joint] else SWAY
    return found


def _sunk(model: mujoco.MjModel, carrier: int, pose: np.ndarray, room: np.ndarray) -> float:
    """[m] How deep a robot is in fixed bodies, at most, where its joints sway as far as they may."""
    random, data, deepest = np.random.default_rng(0), mujoco.MjData(model), 0.0
    for signs in random.choice((-1.0, 1.0), size=(_SWAYS, model.nq)):
        data.qpos[:] = pose + room * signs
        mujoco.mj_fwdPosition(model, data)
        deepest = max(deepest, *(-contact.dist for contact in footing(model, data, carrier)), 0.0)
    return deepest if deepest < _MOST_LIFT else 0.0


def footing(model: mujoco.MjModel, data: mujoco.MjData, carrier: int) -> list[mujoco.MjContact]:
    """Each contact between the bodies that `carrier` carries and fixed ones."""
    found: list[mujoco.MjContact] = []
    for contact in data.contact[: data.ncon]:
        bodies = model.geom_bodyid[contact.geom[contact.geom >= 0]]  # -1 for soft bodies
        fixed, own = model.body_weldid[bodies] == 0, model.body_rootid[bodies] == carrier
        if fixed.any() and own.any():
            found.append(contact)
    return found
