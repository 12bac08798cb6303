"""The state table of a drafted task, and Python that computes it.

What has a name in the model is found by that name when the task starts, so that the file stays right when the model is
edited.
"""

from __future__ import annotations

import keyword
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ..tasks.anatomy import BALL, FREE, HINGE, SLIDE, along_x, axis, name_of, named, scalar_joints
from ..tasks.task import Task
from ..types import StateUse
from .sensors import readings
from .source import identifier, quoted
from .survey import Point, Survey

_OF_BODIES = ("pos", "quat", "linvel", "angvel")
_OF_DRAFTS = ("obs_buf", "joint_pos", "joint_vel", "goal_pos", "actions", "num_envs")
_OF_RUNNERS = ("forward_speed", "height", "upright")
FIELDS = ("xpos", "xquat", "xipos", "site_xpos", "geom_xpos", "sensordata")
"""Fields of MjData that the values of variables may read."""
_ATTRIBUTES = (
    "sim", "noise", "num_envs", "device", "progress", "distance",
    "qpos", "qvel", "ctrl", "act", "mocap_pos", "mocap_quat", *FIELDS,
    "home", "sway", "middle", "half", "up", "joints", "dofs",
    *(f"{field}_at_start" for field in ("qvel", "act", "mocap_pos", "mocap_quat")),
)  # fmt: skip
"""Attributes of a drafted task, besides those of its variables and those of every task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A state variable, and how a task computes it."""

    name: str
    value: str
    """Python that computes it, (N, size), or (N,) where size is 0."""
    meaning: str
    """In words; may hold Python in braces, as an f-string."""
    size: int = 0
    use: StateUse = "raw"
    seen: Sequence[int] = ()
    """The columns of it that the policy observes."""


class StateTable:
    """The state table of a task about what a survey has found.

    Attributes:
        lines: of `__init__`; they set what the values of variables refer to. `names` there is a `tasks.names.Names`.
    """

    def __init__(self, survey: Survey) -> None:
        self.survey, self.model = survey, survey.model
        self.lines: list[str] = []
        self._names: dict[tuple[str, int], str] = {}
        self._taken: set[str] = {*_OF_DRAFTS, *_OF_RUNNERS}
        self._attributes: dict[tuple[str, int], tuple[str, ...]] = {}
        self._held: set[str] = {*dir(Task), *_ATTRIBUTES, *_OF_DRAFTS}
        for link in survey.links:
            self._beginning("BODY", link.body)

    def variable(self, place: Point) -> str:
        """The name of the state variable that holds a place's position."""
        return f"{self._beginning(place.kind, place.index)}_pos"

    def value(self, place: Point) -> str:
        """Python for a place's position, (N, 3)."""
        return f"self.{place.field}[:, self.{self._index(place.kind, place.index)}].clone()"

    def variables(self, mover: Point | None = None, hand: Point | None = None) -> Iterator[Variable]:
        """The variables, with the positions of `hand` and of `mover`, which the task is about and the policy sees."""
        told, known = self.variable(mover) if mover else "", set[str]()
        for variable in self._all():
            yield replace(variable, seen=range(variable.size)) if variable.name == told else variable
            known.add(variable.name)
        for place in (mover, hand):
            if place and self.variable(place) not in known:
                yield self._position(place, seen=place is mover)

    @property
    def joints(self) -> list[str]:
        """Names of hinges and slides; those that the model gives no name are numbered."""
        return [name_of(self.model, "JOINT", j) or named(self.model, "JOINT", j) for j in scalar_joints(self.model)]

    def _all(self) -> Iterator[Variable]:
        survey = self.survey
        joints = list(self._joints())
        if survey.base is not None:
            yield from self._carried(survey.base)
        yield from joints
        yield from self._floating()
        for thing in survey.objects:
            if self.model.jnt_type[self.model.body_jntadr[thing.body]] != FREE:
                yield self._position(thing, seen=True)
        for link in survey.links:
            yield self._position(link, seen=False)
        yield from self._sensors()

    def _position(self, place: Point, *, seen: bool) -> Variable:
        meaning = f"{'centre of mass' if place.field == 'xipos' else 'position'} of {place.name} [m]"
        name, observed = self.variable(place), range(3) if seen else ()
        return Variable(name=name, value=self.value(place), meaning=meaning, size=3, use="point", seen=observed)

    def _sensors(self) -> Iterator[Variable]:
        """What the model's own sensors measure; the policy sees what joints and positions do not tell."""
        for reading in readings(self.model):
            first, size = int(self.model.sensor_adr[reading.index]), 0 if reading.size == 1 else reading.size
            number = str(slice(first, first + size)) if size else str(first)
            (found,) = self._found("SENSOR", reading.index, "sensor", [number], [""])
            value = f"self.sensordata[:, self.{found}]"
            yield Variable(
                name=self._unused(identifier(reading.name)),
                value=f"xyzw({value})" if reading.quaternion else f"{value}.clone()",
                meaning=reading.meaning,
                size=size,
                use=reading.use,
                seen=range(max(1, size)) if reading.felt else (),
            )

    def _carried(self, body: int) -> Iterator[Variable]:
        """Speed, height and uprightness of a robot that moves about."""
        called, index = named(self.model, "BODY", body), self._index("BODY", body)
        dof = along_x(self.model, body)
        joint = int(self.model.dof_jntid[dof])
        if self.model.jnt_type[joint] == FREE:
            value = f"self.qvel[:, self.{self._free(body)[0]}][:, 0].clone()"
        else:
            backwards = "-" if axis(self.model, joint)[0] < 0.0 else ""
            value = f"{backwards}self.qvel[:, self.dofs][:, {scalar_joints(self.model).index(joint)}]"
        meaning = f"speed of {called} along x [m/s]"
        yield Variable(name="forward_speed", value=value, meaning=meaning, use="directional")
        meaning = f"height of {called} [m], {round(self.survey.height, 4):g} at the start"
        value, seen = f"self.xpos[:, self.{index}, 2].clone()", () if self.survey.fallen is None else (0,)
        yield Variable(name="height", value=value, meaning=meaning, use="directional", seen=seen)
        value = f"rotate(xyzw(self.xquat[:, self.{index}]), self.up)[:, 2]"
        meaning = f"cosine of the tilt of {called} against its start"
        yield Variable(name="upright", value=value, meaning=meaning, use="directional")

    def _joints(self) -> Iterator[Variable]:
        joints = scalar_joints(self.model)
        if not joints:
            return
        kinds = {int(self.model.jnt_type[joint]) for joint in joints}
        units = [unit for kind, unit in ((HINGE, "rad"), (SLIDE, "m")) if kind in kinds]
        unit, rate = " or ".join(units), " or ".join(f"{unit}/s" for unit in units)
        if all(name_of(self.model, "JOINT", joint) for joint in joints):
            self.lines.append("self.joints, self.dofs = names.joints(JOINTS)")
        else:
            self.lines.append(
                "# Some joints have no name, so these are indices, which an edit of the model may change."
            )
            for name, numbers in (("joints", self.model.jnt_qposadr), ("dofs", self.model.jnt_dofadr)):
                self.lines.append(f"self.{name} = torch.tensor({numbers[joints].tolist()}, device=self.device)")
        # How far along x and y a robot has come says nothing about what to do next.
        seen = [i for i, joint in enumerate(joints) if not self._travels(joint)]
        meaning = f"positions of the joints [{unit}], in this order: {{', '.join(JOINTS)}}"
        size = len(joints)
        yield Variable(name="joint_pos", value="self.qpos[:, self.joints]", meaning=meaning, size=size, seen=seen)
        meaning = f"velocities of the joints [{rate}], in the same order"
        value, every = "self.qvel[:, self.dofs]", range(size)
        yield Variable(name="joint_vel", value=value, meaning=meaning, size=size, use="zero_centred", seen=every)

    def _travels(self, joint: int) -> bool:
        level = abs(axis(self.model, joint)[2]) < 0.5
        carries = self.model.jnt_bodyid[joint] == self.survey.base
        return bool(carries and self.model.jnt_type[joint] == SLIDE and level)

    def _floating(self) -> Iterator[Variable]:
        """Free bodies, which are the robot or what it handles, and ball joints."""
        for joint in range(self.model.njnt):
            body = int(self.model.jnt_bodyid[joint])
            if self.model.jnt_type[joint] == FREE:
                yield from self._free_body(body)
            elif self.model.jnt_type[joint] == BALL:
                yield from self._ball(joint)

    def _free_body(self, body: int) -> Iterator[Variable]:
        called, name = named(self.model, "BODY", body), self._beginning("BODY", body)
        index, (linear, angular) = self._index("BODY", body), self._free(body)
        quat = f"xyzw(self.xquat[:, self.{index}])"
        placed = range(3) if body != self.survey.base else ()
        yield Variable(
            name=f"{name}_pos",
            value=f"self.xpos[:, self.{index}].clone()",
            meaning=f"position of {called} [m]",
            size=3,
            use="point",
            seen=placed,
        )
        yield self._quat(name, called, quat)
        yield Variable(
            name=f"{name}_linvel",
            value=f"self.qvel[:, self.{linear}].clone()",
            meaning=f"velocity of {called} in the world frame [m/s]",
            size=3,
            use="zero_centred",
            seen=range(3),
        )
        yield self._angvel(name, called, "the world frame", f"rotate({quat}, self.qvel[:, self.{angular}])")

    def _ball(self, joint: int) -> Iterator[Variable]:
        called, name = named(self.model, "JOINT", joint), self._beginning("JOINT", joint)
        place, dof = int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])
        numbers = [str(slice(place, place + 4)), str(slice(dof, dof + 3))]
        quat, angular = self._found("JOINT", joint, "ball", numbers, ["_quat", "_angvel"])
        yield self._quat(name, called, f"xyzw(self.qpos[:, self.{quat}])")
        yield self._angvel(name, called, "its child's frame", f"self.qvel[:, self.{angular}].clone()")

    def _quat(self, name: str, called: str, value: str) -> Variable:
        meaning = f"orientation of {called}, quaternion x, y, z, w"
        return Variable(name=f"{name}_quat", value=value, meaning=meaning, size=4, seen=range(4))

    def _angvel(self, name: str, called: str, frame: str, value: str) -> Variable:
        meaning = f"angular velocity of {called} in {frame} [rad/s]"
        return Variable(name=f"{name}_angvel", value=value, meaning=meaning, size=3, use="zero_centred", seen=range(3))

    def _index(self, kind: str, index: int) -> str:
        """The attribute that holds the number of a body, site or geom."""
        return self._found(kind, index, kind.lower(), [str(index)], [""])[0]

    def _free(self, body: int) -> tuple[str, ...]:
        """Attributes that hold the columns of `qvel` of a body on a free joint."""
        dof = int(self.model.jnt_dofadr[self.model.body_jntadr[body]])
        numbers = [str(slice(dof, dof + 3)), str(slice(dof + 3, dof + 6))]
        return self._found("BODY", body, "free", numbers, ["_linvel", "_angvel"])

    def _found(
        self, kind: str, index: int, method: str, numbers: Sequence[str], endings: Sequence[str]
    ) -> tuple[str, ...]:
        """Attributes of the task that hold where something is in MuJoCo's fields; a line of `__init__` sets them.

        Args:
            method: the method of `Names` that finds it.
            numbers: Python for the numbers that this method gives, used where the model has no name for it.
            endings: of the attributes' names.
        """
        key = f"{kind} {method}", index
        if key not in self._attributes:
            name, real = identifier(named(self.model, kind, index)), name_of(self.model, kind, index)
            while keyword.iskeyword(name) or self._held & {f"{name}{ending}" for ending in endings}:
                name += "_"
            self._attributes[key] = tuple(f"{name}{ending}" for ending in endings)
            self._held.update(self._attributes[key])
            targets = ", ".join(f"self.{attribute}" for attribute in self._attributes[key])
            call = f"names.{method}({quoted(real)})" if real else f"{', '.join(numbers)}  # it has no name in the model"
            self.lines.append(f"{targets} = {call}")
        return self._attributes[key]

    def _beginning(self, kind: str, index: int) -> str:
        """The beginning of the names of variables of a `BODY`, `JOINT`, `SITE` or `GEOM`, which nothing else has."""
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
