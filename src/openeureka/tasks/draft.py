"""Drafts a task file from a MuJoCo model: what can be read off the robot, and a first guess at what it is for.

A robot with a floating base, or one that slides and turns in a plane, shall run forward; any other shall bring its last
link to a point it can reach. That is a beginning which trains, and the file says where a person's own wish belongs.
"""

from __future__ import annotations

import keyword
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import jinja2
import mujoco
import numpy as np

from ..errors import TaskError
from ..types import StateUse

CONTROL_DT = 0.02
"""[s] between two actions, or the model's own timestep if that is longer."""
SECONDS = 10.0
"""Of an episode."""
FALLEN = 0.6
"""Share of its height at the start below which a robot has fallen."""
NEAR = 0.2
"""Share of its way to the goal within which a link has reached it."""
SWAY = 0.05
"""[rad] or [m] by which joints differ at the start of an episode."""
MOST_LINKS = 8
"""Ends of limbs whose positions are state."""

_SLIDE, _HINGE, _FREE, _BALL = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("SLIDE", "HINGE", "FREE", "BALL")
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A state variable of the draft."""

    name: str
    value: str
    """The expression that computes it, (N, ...)."""
    meaning: str
    size: int = 0
    """Numbers of a world; 0 for one that has no axis."""
    use: StateUse = "raw"
    observed: str = ""
    """The part of it that the policy sees, (N, k); empty for nothing."""
    width: int = 0
    """k."""

    @property
    def declaration(self) -> str:
        """Its line, or lines, of the state table."""
        shape = f"shape=({self.size},)" if self.size else ""
        meaning = f'"{self.meaning}"' if self.name != "joint_pos" else f"f\"{self.meaning}{{', '.join(JOINTS)}}\""
        use = f'use="{self.use}"' if self.use != "raw" else ""
        words = [word for word in (f'name="{self.name}"', shape, f"meaning={meaning}", use) if word]
        line = f"StateVar({', '.join(words)}),"
        if len(line) <= 108:
            return line
        return "\n".join(("StateVar(", *(f"                {word}," for word in words), "            ),"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """What the robot shall do, as far as a model tells."""

    runs: bool
    body: str
    """What runs, or is brought to the goal, as the model calls it."""
    variable: str
    """Its position, or its height."""
    fallen: float = 0.0
    """[m] height below which an episode ends; 0 for a robot that cannot fall."""
    up: tuple[float, ...] = ()
    """The world's z at the start, in the frame of the body that runs."""
    goal: tuple[float, ...] = ()
    reached: float = 0.0
    """[m]"""


def draft(path: Path, robot: Path, intent: str = "") -> str:
    """The text of a task file.

    Args:
        path: where it will be; its name names the class.
        robot: the model, MJCF or URDF.
        intent: the sentence that a language model will read; empty for that of the first guess.

    Raises:
        TaskError: when MuJoCo cannot read the model, or it has no actuators.
    """
    model = _read(robot)
    aim, variables = _Survey(model).found()
    guess = (
        f"to make the {path.stem} run forward as fast as possible" if aim.runs else f"to bring {aim.body} to the goal"
    )
    step = float(model.opt.timestep)
    substeps = max(1, round(CONTROL_DT / step))
    limits = [tuple(pair) if limited else (-1.0, 1.0) for pair, limited in _controls(model)]
    joints = _scalar_joints(model)
    moved = [joint for joint in joints if not aim.runs or model.jnt_bodyid[joint] not in _bases(model)]
    return _template().render(
        name=class_name(path),
        env=path.stem,
        path=path,
        robot=robot,
        place=_place(path, robot),
        description=" ".join((intent or guess).split()).replace('"', "'").replace("\\", "/"),
        aim=aim,
        variables=variables,
        width=sum(variable.width for variable in variables),
        joints=_tuple([f'"{_named(model, "JOINT", joint)}"' for joint in joints]),
        home=_tuple([_number(value) for value in _home(model)]),
        controls=_tuple([f"({_number(low)}, {_number(high)})" for low, high in limits]),
        moved=_columns([int(model.jnt_qposadr[joint]) for joint in moved]) if moved else "",
        movable=len(moved),
        substeps=substeps,
        control_dt=_number(substeps * step),
        episode=max(2, round(SECONDS / (substeps * step))),
        model=model,
        hidden="(64, 64)" if model.nu < 8 else "(128, 64)",
        sway=SWAY,
    )


def class_name(path: Path) -> str:
    """`my_robot.py` holds the class MyRobot."""
    name = "".join(part.capitalize() for part in re.split(r"\W|_", path.stem) if part)
    return name if name.isidentifier() and not keyword.iskeyword(name) else f"Task{name}"


def _read(robot: Path) -> mujoco.MjModel:
    if not robot.is_file():
        raise TaskError(f"There is no model {robot}; name a MuJoCo XML file, for example model=hopper.xml.")
    try:
        model = mujoco.MjSpec.from_file(str(robot)).compile()
    except (ValueError, mujoco.FatalError) as error:
        raise TaskError(f"MuJoCo cannot read {robot}: {' '.join(str(error).split())}.") from None
    if not model.nu:
        raise TaskError(f"{robot} has no actuators, so nothing can move it; add some to the model.")
    return model


def _controls(model: mujoco.MjModel) -> Iterator[tuple[np.ndarray, bool]]:
    """Range of each actuator's input, and whether it has one."""
    return zip(model.actuator_ctrlrange, model.actuator_ctrllimited.astype(bool), strict=True)


class _Survey:
    """Reads the state variables off a model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.data.qpos[:] = _home(model)
        mujoco.mj_forward(model, self.data)
        self._taken = {"obs_buf", "actions", "num_envs", "joint_pos", "joint_vel", "goal_pos", "forward_speed"}
        self._taken |= {"height", "upright"}

    def found(self) -> tuple[Aim, list[Variable]]:
        bases = _bases(self.model)
        links = {body: self._body(body) for body in self._links()}
        aim = self._running(bases[0]) if bases else self._reaching(links)
        variables = [*(self._base(bases[0], aim) if bases else ()), *self._joints(), *self._floating(bases)]
        for body, name in links.items():
            at = f"self.xipos[:, {body}].clone()"
            seen = name if f"{name}_pos" == aim.variable else ""
            variables.append(
                Variable(
                    name=f"{name}_pos",
                    value=at,
                    meaning=f"centre of mass of {self._called(body)} [m]",
                    size=3,
                    use="point",
                    observed=f's["{name}_pos"]' if seen else "",
                    width=3 if seen else 0,
                )
            )
        return aim, variables

    def _base(self, body: int, aim: Aim) -> Iterator[Variable]:
        """How far, high and upright a robot is that runs."""
        turn = f"rotate(xyzw(self.xquat[:, {body}]), self.up)[:, 2]"
        name = self._called(body)
        dof = _forward(self.model, body)
        backwards = self.model.jnt_axis[self.model.dof_jntid[dof]][0] < 0.0
        speed = f"-self.qvel[:, {dof}]" if backwards else f"self.qvel[:, {dof}].clone()"
        meaning = f"speed of {name} along x [m/s]"
        yield Variable(name="forward_speed", value=speed, meaning=meaning, use="directional")
        height = f"self.xpos[:, {body}, 2].clone()"
        meaning = f"height of {name} [m], {_number(self.data.xpos[body, 2])} at the start"
        yield Variable(
            name="height",
            value=height,
            meaning=meaning,
            use="directional",
            observed='s["height"][:, None]' if aim.fallen else "",
            width=int(aim.fallen > 0),
        )
        meaning = f"cosine of the tilt of {name} against its start"
        yield Variable(name="upright", value=turn, meaning=meaning, use="directional")

    def _joints(self) -> Iterator[Variable]:
        joints = _scalar_joints(self.model)
        if not joints:
            return
        kinds = {int(self.model.jnt_type[joint]) for joint in joints}
        unit = " or ".join(unit for kind, unit in ((_HINGE, "rad"), (_SLIDE, "m")) if kind in kinds)
        rate = " or ".join(f"{part}/s" for part in unit.split(" or "))
        positions, speeds = (
            _columns([int(address[joint]) for joint in joints])
            for address in (self.model.jnt_qposadr, self.model.jnt_dofadr)
        )
        # How far along x and y a robot has come says nothing about what to do next.
        bases = _bases(self.model)
        here = [i for i, joint in enumerate(joints) if not (bases and self._travels(joint, bases[0]))]
        seen = 's["joint_pos"]' if len(here) == len(joints) else f's["joint_pos"][:, {_columns(here)}]'
        yield Variable(
            name="joint_pos",
            value=f"self.qpos[:, {positions}].clone()",
            meaning=f"positions of the joints [{unit}], in this order: ",
            size=len(joints),
            observed=seen,
            width=len(here),
        )
        yield Variable(
            name="joint_vel",
            value=f"self.qvel[:, {speeds}].clone()",
            meaning=f"velocities of the joints [{rate}], in the same order",
            size=len(joints),
            use="zero_centred",
            observed='s["joint_vel"]',
            width=len(joints),
        )

    def _travels(self, joint: int, base: int) -> bool:
        level = abs(self.model.jnt_axis[joint][2]) < 0.5
        return bool(self.model.jnt_bodyid[joint] == base and self.model.jnt_type[joint] == _SLIDE and level)

    def _floating(self, bases: Sequence[int]) -> Iterator[Variable]:
        """Whatever moves freely, the robot itself or what it handles, and joints like a shoulder's."""
        for joint in range(self.model.njnt):
            place, dof = int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])
            body = int(self.model.jnt_bodyid[joint])
            if self.model.jnt_type[joint] == _FREE:
                name = self._body(body)
                root = f"root_state(self.qpos[:, {place}:{place + 7}], self.qvel[:, {dof}:{dof + 6}])"
                yield from self._body_state(name, self._called(body), root, robot=body in bases)
            elif self.model.jnt_type[joint] == _BALL:
                name, called = self._free_name(_named(self.model, "JOINT", joint)), _named(self.model, "JOINT", joint)
                quat, rate = f"{name}_quat", f"{name}_angvel"
                meaning = f"orientation of the ball joint {called}, quaternion x, y, z, w"
                yield Variable(
                    name=quat,
                    value=f"xyzw(self.qpos[:, {place}:{place + 4}])",
                    meaning=meaning,
                    size=4,
                    observed=f's["{quat}"]',
                    width=4,
                )
                meaning = f"angular velocity of the ball joint {called} in its child's frame [rad/s]"
                value = f"self.qvel[:, {dof}:{dof + 3}].clone()"
                yield Variable(
                    name=rate,
                    value=value,
                    meaning=meaning,
                    size=3,
                    use="zero_centred",
                    observed=f's["{rate}"]',
                    width=3,
                )

    def _body_state(self, name: str, called: str, root: str, *, robot: bool) -> Iterator[Variable]:
        parts: tuple[tuple[str, str, str, int, StateUse, bool], ...] = (
            ("pos", "0:3", f"position of {called} [m]", 3, "point", not robot),
            ("quat", "3:7", f"orientation of {called}, quaternion x, y, z, w", 4, "raw", True),
            ("linvel", "7:10", f"velocity of {called} in the world frame [m/s]", 3, "zero_centred", True),
            ("angvel", "10:13", f"angular velocity of {called} in the world frame [rad/s]", 3, "zero_centred", True),
        )
        for part, columns, meaning, size, use, seen in parts:
            variable = f"{name}_{part}"
            yield Variable(
                name=variable,
                value=f"{root}[:, {columns}]",
                meaning=meaning,
                size=size,
                use=use,
                observed=f's["{variable}"]' if seen else "",
                width=size if seen else 0,
            )

    def _links(self) -> Iterator[int]:
        """Ends of the limbs, those behind most joints first; no free body by itself."""
        model = self.model
        parents = set(model.body_parentid[1:].tolist())
        free = {int(model.jnt_bodyid[joint]) for joint in range(model.njnt) if model.jnt_type[joint] == _FREE}
        ends = [
            body for body in range(1, model.nbody) if body not in parents and self._behind(body) and body not in free
        ]
        yield from sorted(ends, key=lambda body: (-self._behind(body), body))[:MOST_LINKS]

    def _behind(self, body: int) -> int:
        """Driven joints between a body and the world."""
        driven, count = _driven(self.model), 0
        while body:
            count += sum(int(self.model.jnt_bodyid[joint]) == body for joint in driven)
            body = int(self.model.body_parentid[body])
        return count

    def _running(self, body: int) -> Aim:
        height = float(self.data.xpos[body, 2])
        fallen = round(FALLEN * height, 3) if height > 0.05 and _rises(self.model, body) else 0.0
        up = self.data.xmat[body].reshape(3, 3)[2].round(4) + 0.0
        return Aim(
            runs=True, body=self._called(body), variable="height", fallen=fallen, up=tuple(float(part) for part in up)
        )

    def _reaching(self, links: Mapping[int, str]) -> Aim:
        """A link and a place that it gets to: the median of where random poses bring it."""
        if not links:
            raise TaskError("The model has no body that a driven joint moves; add a joint or a target of an actuator.")
        body, name = next(iter(links.items()))
        start = self.data.xipos[body].copy()
        random, places = np.random.default_rng(0), []
        for _ in range(101):
            self.data.qpos[:] = _home(self.model)
            for joint in _driven(self.model):
                if self.model.jnt_type[joint] in (_SLIDE, _HINGE):
                    low, high = self.model.jnt_range[joint] if self.model.jnt_limited[joint] else (-1.0, 1.0)
                    self.data.qpos[self.model.jnt_qposadr[joint]] = random.uniform(low, high)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            places.append(self.data.xipos[body].copy())
        goal = sorted(places, key=lambda place: float(np.linalg.norm(place - start)))[50].round(3)
        reached = max(0.01, round(NEAR * float(np.linalg.norm(goal - start)), 3))
        goal = tuple(goal.tolist())
        return Aim(runs=False, body=self._called(body), variable=f"{name}_pos", goal=goal, reached=reached)

    def _called(self, body: int) -> str:
        return _named(self.model, "BODY", body)

    def _body(self, body: int) -> str:
        return self._free_name(self._called(body))

    def _free_name(self, called: str) -> str:
        """The beginning of variable names that nothing else has."""
        name = _identifier(called)
        while {f"{name}_{part}" for part in ("pos", "quat", "linvel", "angvel")} & self._taken:
            name += "_"
        self._taken |= {f"{name}_{part}" for part in ("pos", "quat", "linvel", "angvel")}
        return name


def _driven(model: mujoco.MjModel) -> list[int]:
    """Joints that an actuator moves, by itself or through a tendon."""
    joints: list[int] = []
    for actuator in range(model.nu):
        kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
        if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
            joints.append(target)
        elif kind == int(mujoco.mjtTrn.mjTRN_TENDON):
            start, count = int(model.tendon_adr[target]), int(model.tendon_num[target])
            wraps = range(start, start + count)
            joint = int(mujoco.mjtWrap.mjWRAP_JOINT)
            joints += [int(model.wrap_objid[wrap]) for wrap in wraps if int(model.wrap_type[wrap]) == joint]
    return joints


def _bases(model: mujoco.MjModel) -> list[int]:
    """Bodies by which robots move through the world: joints that nothing drives, one of them free or along x, and
    driven joints behind them."""
    driven = {int(model.jnt_bodyid[joint]) for joint in _driven(model)}
    carriers = {int(model.body_rootid[body]) for body in driven} - driven
    return [body for body in sorted(carriers) if _forward(model, body) is not None]


def _forward(model: mujoco.MjModel, body: int) -> int | None:
    """The degree of freedom that carries a body along x."""
    for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
        along = model.jnt_type[joint] == _SLIDE and abs(model.jnt_axis[joint][0]) > 0.9
        if model.jnt_type[joint] == _FREE or along:
            return int(model.jnt_dofadr[joint])
    return None


def _rises(model: mujoco.MjModel, body: int) -> bool:
    """Whether a base can move up and down."""
    joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
    return any(
        model.jnt_type[joint] == _FREE or (model.jnt_type[joint] == _SLIDE and abs(model.jnt_axis[joint][2]) > 0.5)
        for joint in joints
    )


def _scalar_joints(model: mujoco.MjModel) -> list[int]:
    return [joint for joint in range(model.njnt) if model.jnt_type[joint] in (_SLIDE, _HINGE)]


def _home(model: mujoco.MjModel) -> np.ndarray:
    """The first keyframe, or the pose as drawn; joints are kept so far inside their range that they may sway."""
    pose = (model.key_qpos[0] if model.nkey else model.qpos0).copy()
    for joint in _scalar_joints(model):
        low, high = model.jnt_range[joint]
        if model.jnt_limited[joint] and high - low > 4.0 * SWAY:
            place = model.jnt_qposadr[joint]
            pose[place] = min(max(pose[place], low + SWAY), high - SWAY)
    return pose


def _named(model: mujoco.MjModel, kind: str, index: int) -> str:
    named = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), index)
    return re.sub(r"[\"\\\s]", "_", named) if named else f"{kind.lower()}{index}"


def _identifier(name: str) -> str:
    return re.sub(r"\W|^(?=\d)", "_", name)


def _columns(indices: Sequence[int]) -> str:
    """As a slice where they follow each other, else as a list."""
    first, last = indices[0], indices[-1]
    return f"{first}:{last + 1}" if list(indices) == list(range(first, last + 1)) else f"{list(indices)}"


def _number(value: float) -> str:
    return repr(float(f"{value:.6g}"))


def _tuple(items: Sequence[str]) -> str:
    """Python for a tuple, as short as it can be said in lines of 120 characters."""
    if len(items) > 1 and len(set(items)) == 1:
        return f"({items[0]},) * {len(items)}"
    lines = [""]
    for item in items:
        if len(lines[-1]) + len(item) > 100:
            lines.append("")
        lines[-1] += f"{item}, "
    if len(lines) == 1:
        return f"({lines[0].strip() if len(items) == 1 else lines[0].rstrip(', ')})"
    return "(\n" + "".join(f"    {line.rstrip()}\n" for line in lines) + ")"


def _place(path: Path, robot: Path) -> str:
    """Python that finds the model: beside the file where it is there or below, else where it is now."""
    folder, robot = path.resolve().parent, robot.resolve()
    if robot.is_relative_to(folder):
        return f'Path(__file__).parent / "{os.path.relpath(robot, folder)}"'
    return f'Path("{robot}")'


def _template() -> jinja2.Template:
    text = (files("openeureka") / "templates" / "task.py.jinja").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return environment.from_string(text)
