"""What can be read off a MuJoCo model: how a robot moves, the state variables of a task, and a guess at its aim."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from ..errors import TaskError
from ..types import StateUse

FALLEN = 0.6
"""Share of its height at the start below which a robot has fallen."""
NEAR = 0.2
"""Share of its way to the goal within which a link has reached it."""
SWAY = 0.05
"""[rad] or [m] by which joints differ at the start of an episode."""
MOST_LINKS = 8
"""Ends of limbs whose positions are state."""
POSES = 101
"""Tried at random to find a goal."""

_SLIDE, _HINGE, _FREE, _BALL = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("SLIDE", "HINGE", "FREE", "BALL")
)
_JOINT, _JOINT_IN_PARENT, _TENDON, _SITE = (
    int(getattr(mujoco.mjtTrn, f"mjTRN_{name}")) for name in ("JOINT", "JOINTINPARENT", "TENDON", "SITE")
)
_OF_BODIES = ("pos", "quat", "linvel", "angvel")


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A state variable, and how a task computes it."""

    name: str
    value: str
    """Python for it, (N, size), or (N,) where size is 0."""
    meaning: str
    """May hold Python in braces."""
    size: int = 0
    use: StateUse = "raw"
    seen: Sequence[int] = ()
    """The numbers of it that the policy observes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """What a robot shall do, as far as a model tells: run along x, or bring a link to a goal."""

    body: str
    """What runs, or is brought to the goal, as the model calls it."""
    up: tuple[float, ...] = ()
    """The world's z at the start, in the frame of the body that runs."""
    fallen: float = 0.0
    """[m] height of it below which an episode ends; 0 for a robot that cannot fall."""
    goal: tuple[float, ...] = ()
    """[m]; empty for a robot that runs."""
    reached: float = 0.0
    """[m]"""
    variable: str = ""
    """Where the link is."""


class Survey:
    """Of one model in its home pose.

    Raises:
        TaskError: when nothing that a task could be about moves.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self._data = mujoco.MjData(model)
        self._pose(home(model))
        self._driven = driven_joints(model)
        self._taken: set[str] = set()
        self.base = base(model)
        self._links = {body: self._beginning(named(model, "BODY", body)) for body in self._ends()}
        self.aim = self._reaching() if self.base is None else self._running(self.base)

    def variables(self) -> Iterator[Variable]:
        if self.base is not None:
            yield from self._carried(self.base)
        yield from self._joints()
        yield from self._floating()
        for body, name in self._links.items():
            meaning = f"centre of mass of {named(self.model, 'BODY', body)} [m]"
            value, seen = f"self.xipos[:, {body}].clone()", range(3) if self.aim.variable == f"{name}_pos" else ()
            yield Variable(name=f"{name}_pos", value=value, meaning=meaning, size=3, use="point", seen=seen)

    def _carried(self, body: int) -> Iterator[Variable]:
        """How fast, high and upright a robot is that runs."""
        called, height = self.aim.body, self._data.xpos[body, 2]
        dof = _along_x(self.model, body)
        backwards = self.model.jnt_axis[self.model.dof_jntid[dof]][0] < 0.0
        value = f"-self.qvel[:, {dof}]" if backwards else f"self.qvel[:, {dof}].clone()"
        meaning = f"speed of {called} along x [m/s]"
        yield Variable(name="forward_speed", value=value, meaning=meaning, use="directional")
        value, seen = f"self.xpos[:, {body}, 2].clone()", (0,) if self.aim.fallen else ()
        meaning = f"height of {called} [m], {height:.4g} at the start"
        yield Variable(name="height", value=value, meaning=meaning, use="directional", seen=seen)
        value = f"rotate(xyzw(self.xquat[:, {body}]), self.up)[:, 2]"
        meaning = f"cosine of the tilt of {called} against its start"
        yield Variable(name="upright", value=value, meaning=meaning, use="directional")

    def _joints(self) -> Iterator[Variable]:
        joints = scalar_joints(self.model)
        if not joints:
            return
        kinds = {int(self.model.jnt_type[joint]) for joint in joints}
        units = [unit for kind, unit in ((_HINGE, "rad"), (_SLIDE, "m")) if kind in kinds]
        unit, rate = " or ".join(units), " or ".join(f"{unit}/s" for unit in units)
        place = columns([int(self.model.jnt_qposadr[joint]) for joint in joints])
        dof = columns([int(self.model.jnt_dofadr[joint]) for joint in joints])
        # How far along x and y a robot has come says nothing about what to do next.
        seen = [i for i, joint in enumerate(joints) if not self._travels(joint)]
        value = f"self.qpos[:, {place}].clone()"
        meaning = f"positions of the joints [{unit}], in this order: {{', '.join(JOINTS)}}"
        yield Variable(name="joint_pos", value=value, meaning=meaning, size=len(joints), seen=seen)
        value, meaning = f"self.qvel[:, {dof}].clone()", f"velocities of the joints [{rate}], in the same order"
        size = len(joints)
        yield Variable(name="joint_vel", value=value, meaning=meaning, size=size, use="zero_centred", seen=range(size))

    def _travels(self, joint: int) -> bool:
        level = abs(self.model.jnt_axis[joint][2]) < 0.5
        return bool(self.model.jnt_bodyid[joint] == self.base and self.model.jnt_type[joint] == _SLIDE and level)

    def _floating(self) -> Iterator[Variable]:
        """Bodies that move freely, the robot or what it handles, and joints like a shoulder's."""
        for joint in range(self.model.njnt):
            place, dof = int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])
            body = int(self.model.jnt_bodyid[joint])
            if self.model.jnt_type[joint] == _FREE:
                state = f"root_state(self.qpos[:, {place}:{place + 7}], self.qvel[:, {dof}:{dof + 6}])"
                parts = [f"{state}[:, {part}]" for part in ("0:3", "3:7", "7:10", "10:13")]
                called, where = named(self.model, "BODY", body), "in the world frame"
                yield from self._pose_and_speed(called, where, parts, placed=body != self.base)
            elif self.model.jnt_type[joint] == _BALL:
                parts = ["", f"xyzw(self.qpos[:, {place}:{place + 4}])", "", f"self.qvel[:, {dof}:{dof + 3}].clone()"]
                called, where = named(self.model, "JOINT", joint), "in its child's frame"
                yield from self._pose_and_speed(called, where, parts, placed=False)

    def _pose_and_speed(self, called: str, where: str, values: Sequence[str], *, placed: bool) -> Iterator[Variable]:
        """Variables of a body or ball joint, those that have a value; `placed`: its position is observed too."""
        name = self._beginning(called)
        meanings: tuple[tuple[str, int, StateUse], ...] = (
            (f"position of {called} [m]", 3, "point"),
            (f"orientation of {called}, quaternion x, y, z, w", 4, "raw"),
            (f"velocity of {called} {where} [m/s]", 3, "zero_centred"),
            (f"angular velocity of {called} {where} [rad/s]", 3, "zero_centred"),
        )
        for part, value, (meaning, size, use) in zip(_OF_BODIES, values, meanings, strict=True):
            seen = range(size) if placed or part != "pos" else ()
            if value:
                yield Variable(name=f"{name}_{part}", value=value, meaning=meaning, size=size, use=use, seen=seen)

    def _ends(self) -> list[int]:
        """Ends of the limbs, those behind most driven joints first."""
        model, parents = self.model, set(self.model.body_parentid[1:].tolist())
        behind = {body: self._behind(body) for body in range(1, model.nbody) if body not in parents}
        ends = [body for body, count in behind.items() if count]
        return sorted(ends, key=lambda body: (-behind[body], body))[:MOST_LINKS]

    def _behind(self, body: int) -> int:
        """Driven joints between a body and the world."""
        bodies, count = [int(self.model.jnt_bodyid[joint]) for joint in self._driven], 0
        while body:
            count += bodies.count(body)
            body = int(self.model.body_parentid[body])
        return count

    def _running(self, body: int) -> Aim:
        height = float(self._data.xpos[body, 2])
        fallen = round(FALLEN * height, 3) if height > 0.05 and _rises(self.model, body) else 0.0
        up = self._data.xmat[body].reshape(3, 3)[2].round(4) + 0.0
        return Aim(body=named(self.model, "BODY", body), up=tuple(up.tolist()), fallen=fallen)

    def _reaching(self) -> Aim:
        """The end of the longest limb, and where the median of random poses brings it."""
        if not self._links:
            raise TaskError(
                "No joint of the model is driven, and nothing floats: there is nothing that a task could do."
            )
        body, name = next(iter(self._links.items()))
        start, random, places = self._data.xipos[body].copy(), np.random.default_rng(0), []
        pose = home(self.model)
        for _ in range(POSES):
            for joint in self._driven:
                if self.model.jnt_type[joint] in (_SLIDE, _HINGE):
                    low, high = self.model.jnt_range[joint] if self.model.jnt_limited[joint] else (-1.0, 1.0)
                    pose[self.model.jnt_qposadr[joint]] = random.uniform(low, high)
            self._pose(pose)
            places.append(self._data.xipos[body].copy())
        goal = sorted(places, key=lambda place: float(np.linalg.norm(place - start)))[POSES // 2].round(3)
        reached = max(0.01, round(NEAR * float(np.linalg.norm(goal - start)), 3))
        called = named(self.model, "BODY", body)
        return Aim(body=called, goal=tuple(goal.tolist()), reached=reached, variable=f"{name}_pos")

    def _pose(self, qpos: np.ndarray) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self._data)

    def _beginning(self, called: str) -> str:
        """Of variable names that nothing else has."""
        name = re.sub(r"\W|^(?=\d)", "_", called)
        while f"{name}_pos" in {*self._taken, "joint_pos", "goal_pos"}:
            name += "_"
        self._taken.add(f"{name}_pos")
        return name


def home(model: mujoco.MjModel) -> np.ndarray:
    """The first keyframe, or the pose as drawn; joints are kept so far inside their range that they may sway."""
    pose = (model.key_qpos[0] if model.nkey else model.qpos0).copy()
    for joint in scalar_joints(model):
        low, high = model.jnt_range[joint]
        if model.jnt_limited[joint] and high - low > 4.0 * SWAY:
            place = model.jnt_qposadr[joint]
            pose[place] = min(max(pose[place], low + SWAY), high - SWAY)
    return pose


def scalar_joints(model: mujoco.MjModel) -> list[int]:
    """Hinges and slides."""
    return [joint for joint in range(model.njnt) if model.jnt_type[joint] in (_SLIDE, _HINGE)]


def driven_joints(model: mujoco.MjModel) -> list[int]:
    """Joints that an actuator moves, by itself or through a tendon."""
    joints: list[int] = []
    for kind, (target, _) in zip(model.actuator_trntype, model.actuator_trnid, strict=True):
        if kind in (_JOINT, _JOINT_IN_PARENT):
            joints.append(int(target))
        elif kind == _TENDON:
            wraps = slice(model.tendon_adr[target], model.tendon_adr[target] + model.tendon_num[target])
            joints += model.wrap_objid[wraps][model.wrap_type[wraps] == int(mujoco.mjtWrap.mjWRAP_JOINT)].tolist()
    return joints


def base(model: mujoco.MjModel) -> int | None:
    """The body by which a robot moves through the world: by joints that nothing drives, one of them free or along x.
    None for a robot that stands fixed."""
    driven = {int(model.jnt_bodyid[joint]) for joint in driven_joints(model)}
    pushed = model.actuator_trntype == _SITE  # propellers, say
    moved = driven | set(model.site_bodyid[model.actuator_trnid[pushed, 0]].tolist())
    carriers = sorted({int(model.body_rootid[body]) for body in moved} - driven)
    return next((body for body in carriers if _along_x(model, body) is not None), None)


def _own_joints(model: mujoco.MjModel, body: int) -> range:
    return range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])


def _along_x(model: mujoco.MjModel, body: int) -> int | None:
    """The degree of freedom that carries a body along x."""
    for joint in _own_joints(model, body):
        along = model.jnt_type[joint] == _SLIDE and abs(model.jnt_axis[joint][0]) > 0.9
        if model.jnt_type[joint] == _FREE or along:
            return int(model.jnt_dofadr[joint])
    return None


def _rises(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body's own joints let it up and down."""
    return any(
        model.jnt_type[joint] == _FREE or (model.jnt_type[joint] == _SLIDE and abs(model.jnt_axis[joint][2]) > 0.5)
        for joint in _own_joints(model, body)
    )


def named(model: mujoco.MjModel, kind: str, index: int) -> str:
    """What the model calls a `BODY` or `JOINT`, fit for a Python string; its number where it has no name."""
    name = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), index)
    return re.sub(r"[\"\\\s{}]", "_", name) if name else f"{kind.lower()}{index}"


def columns(indices: Sequence[int]) -> str:
    """Python that picks columns: a slice where they follow each other, else a list."""
    first, last = indices[0], indices[-1]
    return f"{first}:{last + 1}" if list(indices) == list(range(first, last + 1)) else f"{list(indices)}"
