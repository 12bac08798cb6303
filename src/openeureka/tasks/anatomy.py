"""Which bodies and joints of a MuJoCo model are a robot's, and what they are called."""

from __future__ import annotations

import re

import mujoco
import numpy as np

SLIDE, HINGE, FREE, BALL = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("SLIDE", "HINGE", "FREE", "BALL")
)
ON_JOINTS = tuple(int(getattr(mujoco.mjtTrn, f"mjTRN_{name}")) for name in ("JOINT", "JOINTINPARENT"))
"""Kinds of transmission to one joint."""
_TENDON, _SITE = (int(getattr(mujoco.mjtTrn, f"mjTRN_{name}")) for name in ("TENDON", "SITE"))


def scalar_joints(model: mujoco.MjModel) -> list[int]:
    """Hinges and slides."""
    return [joint for joint in range(model.njnt) if model.jnt_type[joint] in (SLIDE, HINGE)]


def driven_joints(model: mujoco.MjModel) -> list[int]:
    """Joints that an actuator moves, by itself or through a tendon."""
    joints: list[int] = []
    for kind, (target, _) in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if kind in ON_JOINTS:
            joints.append(int(target))
        elif kind == _TENDON:
            joints += _of_tendon(model, int(target))
    return joints


def _of_tendon(model: mujoco.MjModel, tendon: int) -> list[int]:
    """Joints that a tendon is a sum of, or that it spans: those between the bodies that it is fastened to."""
    wraps = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
    kinds, objects = model.wrap_type[wraps], model.wrap_objid[wraps]
    joints = objects[kinds == int(mujoco.mjtWrap.mjWRAP_JOINT)].tolist()
    bodies = [int(model.site_bodyid[site]) for site in objects[kinds == int(mujoco.mjtWrap.mjWRAP_SITE)]]
    lines = [_line(model, body) for body in bodies]
    common = set.intersection(*map(set, lines)) if lines else set()
    spanned = dict.fromkeys(body for line in lines for body in line if body not in common)
    return joints + [joint for body in spanned for joint in own_joints(model, body)]


def _line(model: mujoco.MjModel, body: int) -> list[int]:
    """A body and its ancestors, without the world."""
    line = []
    while body:
        line.append(body)
        body = int(model.body_parentid[body])
    return line


def _driven_bodies(model: mujoco.MjModel) -> set[int]:
    """Bodies that an actuator moves on a joint or pushes at a site, such as with a propeller."""
    sites = model.actuator_trnid[model.actuator_trntype == _SITE, 0]
    return {int(model.jnt_bodyid[joint]) for joint in driven_joints(model)} | set(model.site_bodyid[sites].tolist())


def driven_trees(model: mujoco.MjModel) -> set[int]:
    """Kinematic trees that an actuator moves."""
    return {int(model.body_treeid[body]) for body in _driven_bodies(model)}


def base(model: mujoco.MjModel) -> int | None:
    """The body that carries a robot through the world, on joints that nothing drives, one of them free or along x. None
    for a robot that is fixed to the world."""
    roots = {int(model.body_rootid[body]) for body in _driven_bodies(model)}
    carriers = sorted(roots - {int(model.jnt_bodyid[joint]) for joint in driven_joints(model)})
    return next((body for body in carriers if along_x(model, body) is not None), None)


def floating_joint(model: mujoco.MjModel) -> int:
    """The free joint whose body carries what actuators move; -1 for none, as for an object that a hand holds."""
    roots = {int(model.body_rootid[body]) for body in _driven_bodies(model)}
    free = (joint for joint in range(model.njnt) if model.jnt_type[joint] == FREE)
    return next((joint for joint in free if int(model.jnt_bodyid[joint]) in roots), -1)


def own_joints(model: mujoco.MjModel, body: int) -> range:
    return range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])


def axis(model: mujoco.MjModel, joint: int) -> np.ndarray:
    """Axis of a joint (3,) in the world frame, in the model's own pose."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data.xaxis[joint].copy()


def along_x(model: mujoco.MjModel, body: int) -> int | None:
    """The degree of freedom that moves a body along x; None for none."""
    for joint in own_joints(model, body):
        along = model.jnt_type[joint] == SLIDE and abs(axis(model, joint)[0]) > 0.9
        if model.jnt_type[joint] == FREE or along:
            return int(model.jnt_dofadr[joint])
    return None


def upwards(model: mujoco.MjModel, body: int) -> tuple[int, float] | None:
    """Index in `qpos` of the joint that moves a body up and down, and how far up a unit of it goes; None for none."""
    for joint in own_joints(model, body):
        place = int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == FREE:
            return place + 2, 1.0
        if model.jnt_type[joint] == SLIDE and abs(height := float(axis(model, joint)[2])) > 0.5:
            return place, height
    return None


def tied(model: mujoco.MjModel) -> set[int]:
    """Joints that an equality constraint of the model couples."""
    named = {int(joint) for equality in _equalities(model, "JOINT") for joint in _objects(model, equality)}
    return looped(model) | (named - {-1})


def looped(model: mujoco.MjModel) -> set[int]:
    """Joints that an equality couples by more than a formula: those between two bodies that it ties, and those of
    tendons."""
    found: set[int] = set()
    for equality in _equalities(model, "TENDON"):
        found |= {joint for tendon in _objects(model, equality) if tendon >= 0 for joint in _of_tendon(model, tendon)}
    for equality in _equalities(model, "CONNECT", "WELD"):
        one, other = (set(_line(model, body)) for body in _ends(model, equality))
        found |= {joint for body in one ^ other for joint in own_joints(model, body)}
    return found


def follow(model: mujoco.MjModel, pose: np.ndarray) -> None:
    """Write into a `qpos` (nq,) where the formulas of equalities hold joints to others."""
    for equality in _equalities(model, "JOINT"):
        one, other = _objects(model, equality)
        place = model.jnt_qposadr[one]
        along = 0.0
        if other >= 0:
            along = pose[model.jnt_qposadr[other]] - model.qpos0[model.jnt_qposadr[other]]
        pose[place] = model.qpos0[place] + np.polynomial.polynomial.polyval(along, model.eq_data[equality, :5])


def _equalities(model: mujoco.MjModel, *kinds: str) -> list[int]:
    """Equalities of these kinds that are active at the start."""
    wanted = [int(getattr(mujoco.mjtEq, f"mjEQ_{kind}")) for kind in kinds]
    return np.flatnonzero(np.isin(model.eq_type, wanted) & (model.eq_active0 != 0)).tolist()


def _objects(model: mujoco.MjModel, equality: int) -> tuple[int, int]:
    return int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])


def _ends(model: mujoco.MjModel, equality: int) -> tuple[int, int]:
    """The two bodies that an equality ties."""
    one, other = _objects(model, equality)
    if model.eq_objtype[equality] == int(mujoco.mjtObj.mjOBJ_SITE):
        return int(model.site_bodyid[one]), int(model.site_bodyid[other])
    return one, other


def moored(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Bodies that an equality ties to a mocap body, each with that body."""
    found: list[tuple[int, int]] = []
    for equality in _equalities(model, "CONNECT", "WELD"):
        one, other = _ends(model, equality)
        found += [(a, b) for a, b in ((one, other), (other, one)) if model.body_mocapid[b] >= 0]
    return found


def carrying(model: mujoco.MjModel, body: int) -> set[int]:
    """Joints between a body and the world."""
    return {joint for part in _line(model, body) for joint in own_joints(model, part)}


def named(model: mujoco.MjModel, kind: str, index: int) -> str:
    """What the model calls a `BODY`, `JOINT`, ..., fit for a Python string; kind and number where it has no name."""
    name = name_of(model, kind, index)
    return re.sub(r"[\"\\\s{}]", "_", name) if name else f"{kind.lower()}{index}"


def name_of(model: mujoco.MjModel, kind: str, index: int) -> str:
    return mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), index) or ""
