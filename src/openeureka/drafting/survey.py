"""What can be read off a MuJoCo model: how a robot moves, what lies about, and the state variables of a task."""

from __future__ import annotations

import keyword
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from ..errors import TaskError
from ..tasks.anatomy import (
    BALL,
    FREE,
    HINGE,
    SLIDE,
    along_x,
    axis,
    base,
    columns,
    driven_joints,
    driven_trees,
    home,
    identifier,
    name_of,
    named,
    own_joints,
    rises,
    scalar_joints,
)
from ..tasks.sensors import readings
from ..types import StateUse
from .controls import servo_range

FALLEN = 0.6
"""Share of its height at the start below which a robot has fallen."""
MOST_LINKS = 8
"""Ends of limbs whose positions are state."""
_OF_BODIES = ("pos", "quat", "linvel", "angvel")
_OF_DRAFTS = ("obs_buf", "joint_pos", "joint_vel", "goal_pos", "actions", "num_envs")
_OF_RUNNERS = ("forward_speed", "height", "upright")


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
class Point:
    """A point of a model that a task can be about."""

    name: str
    """As the model calls it."""
    field: str
    """MuJoCo's field that holds where it is: `xpos`, `xipos`, `site_xpos` or `geom_xpos`."""
    index: int
    body: int
    """That it is a part of; 0 is the world."""

    @property
    def value(self) -> str:
        """Python for it, (N, 3)."""
        return f"self.{self.field}[:, {self.index}].clone()"


class Survey:
    """Of one model in its home pose.

    Raises:
        TaskError: when nothing that a task could be about moves.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self._data = mujoco.MjData(model)
        for field, poses in self._moved_by_hand().items():
            getattr(self._data, field)[:] = poses
        self._pose(home(model))
        self._driven = driven_joints(model)
        self._names: dict[tuple[str, int], str] = {}
        self._taken: set[str] = {*_OF_DRAFTS, *_OF_RUNNERS}
        self.base = base(model)
        self.links = [Point(name=self._called(body), field="xipos", index=body, body=body) for body in self._ends()]
        if self.base is None and not self.links:
            raise TaskError(
                "No actuator of the model drives a joint or a tendon, or pushes what floats at a site, so a draft does"
                " not know what moves: let one drive a joint, or write the task by hand."
            )
        self.objects = self._objects()
        for link in self.links:
            self._beginning("BODY", link.body)

    def _moved_by_hand(self) -> dict[str, np.ndarray]:
        """`mocap_pos` and `mocap_quat` of the first keyframe; none where there is no such body."""
        model = self.model
        if not model.nkey or not model.nmocap:
            return {}
        return {"mocap_pos": model.key_mpos[0].reshape(-1, 3), "mocap_quat": model.key_mquat[0].reshape(-1, 4)}

    @property
    def placed(self) -> dict[str, list[list[float]]]:
        """`mocap_pos` and `mocap_quat` of the start, where it is not as drawn."""
        drawn = mujoco.MjData(self.model)
        poses = self._moved_by_hand().items()
        return {field: pose.tolist() for field, pose in poses if not np.allclose(pose, getattr(drawn, field))}

    @property
    def up(self) -> tuple[float, ...]:
        """The world's z at the start, in the frame of the base."""
        assert self.base is not None
        return tuple((self._data.xmat[self.base].reshape(3, 3)[2].round(4) + 0.0).tolist())

    @property
    def fallen(self) -> float:
        """[m] height of the base below which a robot has fallen; 0 for one that cannot."""
        height = 0.0 if self.base is None else float(self._data.xpos[self.base, 2])
        return round(FALLEN * height, 3) if height > 0.05 and self.rises else 0.0

    @property
    def rises(self) -> bool:
        """Whether the robot as a whole moves up and down."""
        return self.base is not None and rises(self.model, self.base)

    @property
    def has_ground(self) -> bool:
        """Whether anything that stands fixed can be stood on, or nothing pulls down."""
        model = self.model
        fixed = model.body_weldid[model.geom_bodyid] == 0
        stands = bool((fixed & ((model.geom_contype | model.geom_conaffinity) != 0)).any())
        return stands or model.opt.gravity[2] >= 0.0

    @property
    def can_stand(self) -> bool:
        """Whether the robot collides with anything that stands fixed, or nothing pulls down."""
        model = self.model
        fixed = model.body_weldid[model.geom_bodyid] == 0
        own = np.zeros_like(fixed) if self.base is None else model.body_rootid[model.geom_bodyid] == self.base
        kinds, others = model.geom_contype[:, None], model.geom_conaffinity[:, None]
        meets = (kinds[fixed] & others[own].T) | (others[fixed] & kinds[own].T)
        return bool(meets.any()) or model.npair > 0 or model.opt.gravity[2] >= 0.0

    @property
    def root(self) -> Point | None:
        """What runs."""
        return None if self.base is None else self._body(self.base)

    def places(self) -> list[Point]:
        """Every body, site and geom that has a name, in this order."""
        model, links = self.model, {link.body: link for link in self.links}
        found = [links.get(body) or self._body(body) for body in range(1, model.nbody)]
        for kind, bodies in (("SITE", model.site_bodyid), ("GEOM", model.geom_bodyid)):
            field = f"{kind.lower()}_xpos"
            found += [
                Point(name=named(model, kind, i), field=field, index=i, body=int(body)) for i, body in enumerate(bodies)
            ]
        return [place for place in found if name_of(model, _kind(place), place.index)]

    def moves(self, place: Point) -> bool:
        """Whether physics does: a mocap body stays where it is put."""
        whole = self.model.body_weldid[place.body]
        return bool(whole) and bool(self.model.body_mocapid[whole] < 0)

    def are_one(self, place: Point, other: Point) -> bool:
        """Whether nothing can move between both."""
        return bool(self.model.body_weldid[place.body] == self.model.body_weldid[other.body])

    def is_robots(self, place: Point) -> bool:
        """Whether actuators move it."""
        return self.moves(place) and int(self.model.body_treeid[place.body]) in driven_trees(self.model)

    def where(self, place: Point) -> np.ndarray:
        """(3,) at the start [m]."""
        return getattr(self._data, place.field)[place.index].copy()

    def reach(self, place: Point, poses: int) -> np.ndarray:
        """(poses, 3) where random positions of the driven joints bring a part of the robot [m]."""
        random, pose, found = np.random.default_rng(0), home(self.model), []
        ranges = self._ranges()
        for _ in range(poses):
            for joint in self._driven:
                if joint in ranges:
                    pose[self.model.jnt_qposadr[joint]] = random.uniform(*ranges[joint])
            self._pose(pose)
            found.append(self.where(place))
        self._pose(home(self.model))
        return np.array(found)

    def _ranges(self) -> dict[int, np.ndarray]:
        """From where to where (2,) actions bring each driven hinge and slide; without any range -1 to 1, a guess."""
        model, ranges = self.model, dict[int, np.ndarray]()
        for joint in self._driven:
            if model.jnt_type[joint] in (SLIDE, HINGE):
                ranges[joint] = model.jnt_range[joint] if model.jnt_limited[joint] else np.array([-1.0, 1.0])
        for actuator in range(model.nu):
            if found := servo_range(model, actuator):
                joint, held = found
                ranges[joint] = held.clip(*ranges[joint]) if model.jnt_limited[joint] else held
        return ranges

    def radius(self, place: Point) -> float:
        """[m] around the place that what collides of it fills; 0 for a mere mark."""
        if place.field == "site_xpos":
            return 0.0
        model = self.model
        of_body = np.flatnonzero(model.geom_bodyid == place.body).tolist()
        geoms = [place.index] if place.field == "geom_xpos" else of_body
        solid = [geom for geom in geoms if model.geom_contype[geom] or model.geom_conaffinity[geom]]
        centre = self.where(place)
        around = [float(np.linalg.norm(self._data.geom_xpos[g] - centre) + model.geom_rbound[g]) for g in solid]
        return max(around, default=0.0)

    def variable(self, place: Point) -> str:
        """The name of the state variable that says where it is."""
        return f"{self._beginning(_kind(place), place.index)}_pos"

    def variables(self, mover: Point | None = None, hand: Point | None = None) -> Iterator[Variable]:
        """Those of the table, with the position of `mover`, what a task is about, observed, and that of `hand`."""
        told, known = self.variable(mover) if mover else "", set[str]()
        for variable in self._all():
            yield replace(variable, seen=range(variable.size)) if variable.name == told else variable
            known.add(variable.name)
        for place in (mover, hand):
            if place and self.variable(place) not in known:
                yield self._position(place, seen=place is mover)

    def _all(self) -> Iterator[Variable]:
        if self.base is not None:
            yield from self._carried(self.base)
        yield from self._joints()
        yield from self._floating()
        for thing in self.objects:
            if self.model.jnt_type[self.model.body_jntadr[thing.body]] != FREE:
                yield self._position(thing, seen=True)
        for link in self.links:
            yield self._position(link, seen=False)
        yield from self._sensors()

    def _position(self, place: Point, *, seen: bool) -> Variable:
        meaning = f"{'centre of mass' if place.field == 'xipos' else 'position'} of {place.name} [m]"
        name, observed = self.variable(place), range(3) if seen else ()
        return Variable(name=name, value=place.value, meaning=meaning, size=3, use="point", seen=observed)

    def _sensors(self) -> Iterator[Variable]:
        """What the model's own sensors measure; the policy sees what joints and positions do not tell."""
        for reading in readings(self.model):
            value = f"self.sensordata[:, {reading.first}:{reading.first + reading.size}]"
            value = f"xyzw({value})" if reading.quaternion else f"{value}.clone()"
            if reading.size == 1:
                value = f"self.sensordata[:, {reading.first}].clone()"
            size = 0 if reading.size == 1 else reading.size
            yield Variable(
                name=self._unused(identifier(reading.name)),
                value=value,
                meaning=reading.meaning,
                size=size,
                use=reading.use,
                seen=range(max(1, size)) if reading.felt else (),
            )

    def _carried(self, body: int) -> Iterator[Variable]:
        """How fast, high and upright a robot is that runs."""
        called, height = self._called(body), self._data.xpos[body, 2]
        dof = along_x(self.model, body)
        joint = self.model.dof_jntid[dof]
        backwards = self.model.jnt_type[joint] == SLIDE and axis(self.model, joint)[0] < 0.0
        value = f"-self.qvel[:, {dof}]" if backwards else f"self.qvel[:, {dof}].clone()"
        meaning = f"speed of {called} along x [m/s]"
        yield Variable(name="forward_speed", value=value, meaning=meaning, use="directional")
        value, seen = f"self.xpos[:, {body}, 2].clone()", (0,) if self.fallen else ()
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
        units = [unit for kind, unit in ((HINGE, "rad"), (SLIDE, "m")) if kind in kinds]
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
        level = abs(axis(self.model, joint)[2]) < 0.5
        return bool(self.model.jnt_bodyid[joint] == self.base and self.model.jnt_type[joint] == SLIDE and level)

    def _floating(self) -> Iterator[Variable]:
        """Bodies that move freely, the robot or what it handles, and joints like a shoulder's."""
        for joint in range(self.model.njnt):
            place, dof = int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])
            body = int(self.model.jnt_bodyid[joint])
            if self.model.jnt_type[joint] == FREE:
                state = f"root_state(self.qpos[:, {place}:{place + 7}], self.qvel[:, {dof}:{dof + 6}])"
                parts = [f"{state}[:, {part}]" for part in ("0:3", "3:7", "7:10", "10:13")]
                name, where = self._beginning("BODY", body), "in the world frame"
                yield from self._pose_and_speed(name, self._called(body), where, parts, placed=body != self.base)
            elif self.model.jnt_type[joint] == BALL:
                parts = ["", f"xyzw(self.qpos[:, {place}:{place + 4}])", "", f"self.qvel[:, {dof}:{dof + 3}].clone()"]
                called, where = named(self.model, "JOINT", joint), "in its child's frame"
                name = self._beginning("JOINT", joint)
                yield from self._pose_and_speed(name, called, where, parts, placed=False)

    def _pose_and_speed(
        self, name: str, called: str, where: str, values: Sequence[str], *, placed: bool
    ) -> Iterator[Variable]:
        """Variables of a body or ball joint, those that have a value; `placed`: its position is observed too."""
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
        behind = {body: self.depth(body) for body in range(1, model.nbody) if body not in parents}
        ends = [body for body, count in behind.items() if count]
        return sorted(ends, key=lambda body: (-behind[body], body))[:MOST_LINKS]

    def depth(self, body: int) -> int:
        """Driven joints between a body and the world."""
        bodies, count = [int(self.model.jnt_bodyid[joint]) for joint in self._driven], 0
        while body:
            count += bodies.count(body)
            body = int(self.model.body_parentid[body])
        return count

    def _objects(self) -> list[Point]:
        """What lies or slides about: bodies on a free or sliding joint that no actuator moves."""
        model, driven, found = self.model, driven_trees(self.model), []
        for body in range(1, model.nbody):
            kinds = {int(model.jnt_type[joint]) for joint in own_joints(model, body)}
            outermost = not model.body_weldid[model.body_parentid[body]]
            if outermost and kinds & {FREE, SLIDE} and int(model.body_treeid[body]) not in driven and body != self.base:
                found.append(self._body(body))
        return found

    def _pose(self, qpos: np.ndarray) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self._data)

    def _body(self, body: int) -> Point:
        return Point(name=self._called(body), field="xpos", index=body, body=body)

    def _called(self, body: int) -> str:
        return named(self.model, "BODY", body)

    def _beginning(self, kind: str, index: int) -> str:
        """Of the variable names of a `BODY`, `JOINT`, `SITE` or `GEOM`, which nothing else has."""
        if (kind, index) not in self._names:
            name = identifier(named(self.model, kind, index))
            while self._taken & {f"{name}_{part}" for part in _OF_BODIES}:
                name += "_"
            self._taken |= {f"{name}_{part}" for part in _OF_BODIES}
            self._names[kind, index] = name
        return self._names[kind, index]

    def _unused(self, name: str) -> str:
        while name in self._taken or keyword.iskeyword(name):
            name += "_"
        self._taken.add(name)
        return name


def _kind(place: Point) -> str:
    return {"site_xpos": "SITE", "geom_xpos": "GEOM"}.get(place.field, "BODY")
