"""What can be read off a MuJoCo model: how its robot moves, and its loose objects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..errors import TaskError
from ..tasks.anatomy import (
    FREE,
    HINGE,
    SLIDE,
    base,
    carrying,
    driven_joints,
    driven_trees,
    follow,
    looped,
    moored,
    name_of,
    named,
    own_joints,
    upwards,
)
from ..tasks.start import at_start, footing, home
from .controls import controls, is_bounded, servo_range

FALLEN = 0.6
"""A robot has fallen when its base is below this share of its standing height above the ground."""
SETTLED = 1.0
"""[s] within which a robot that is drawn above the ground lands on it."""
MOST_LINKS = 8
"""Ends of limbs, at most, whose positions are state variables."""
_BROKEN = tuple(getattr(mujoco.mjtWarning, f"mjWARN_BAD{what}") for what in ("QPOS", "QVEL", "QACC"))
"""What MuJoCo warns of where physics diverges, before it resets the state."""
_SHAPELESS = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A point of a model that a task can be about."""

    name: str
    """As the model calls it."""
    field: str
    """MuJoCo's field that holds where it is: `xpos`, `xipos`, `site_xpos` or `geom_xpos`."""
    index: int
    body: int
    """The body that it is a part of; 0 is the world."""

    @property
    def kind(self) -> str:
        """`BODY`, `SITE` or `GEOM`."""
        return {"site_xpos": "SITE", "geom_xpos": "GEOM"}.get(self.field, "BODY")


class Survey:
    """The robot and the objects of one model in its home pose.

    Raises:
        TaskError: when nothing moves that a task could be about.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self._data = mujoco.MjData(model)
        for field in ("mocap_pos", "mocap_quat"):
            getattr(self._data, field)[:] = at_start(model, field)
        self._home = home(model)
        self._pose(self._home)
        self._driven = driven_joints(model)
        self.base = base(model)
        self.links = [Point(name=self._called(body), field="xipos", index=body, body=body) for body in self._ends()]
        if self.base is None and not self.links:
            raise TaskError(
                "No actuator of the model drives a joint or a tendon, or pushes a floating body at a site, so a draft"
                " cannot tell what moves: add an actuator that drives a joint, or write the task by hand."
            )
        self.objects = self._objects()

    @property
    def up(self) -> tuple[float, ...]:
        """The world's z axis in the frame of the base, at the start."""
        assert self.base is not None
        return tuple((self._data.xmat[self.base].reshape(3, 3)[2].round(4) + 0.0).tolist())

    @cached_property
    def fallen(self) -> float | None:
        """[m] z of the base below which a robot has fallen; None for one that cannot fall."""
        if self.base is None or not self.rises:
            return None
        ground, standing = self._landing
        return round(ground + FALLEN * (standing - ground), 3) + 0.0 if standing - ground > 0.05 else None

    @property
    def ground(self) -> float:
        """[m] z of what the robot lands on; 0 where it does not."""
        return self._landing[0]

    @cached_property
    def _landing(self) -> tuple[float, float]:
        """[m] z of the ground and of the base when the robot, drawn above it, first touches it under actions of 0."""
        assert self.base is not None
        model, data = self.model, mujoco.MjData(self.model)
        data.qpos[:] = self._home
        data.ctrl[:] = [(control.low + control.high) / 2.0 for control in controls(model)]
        for _ in range(math.ceil(SETTLED / model.opt.timestep)):
            mujoco.mj_step1(model, data)
            if any(data.warning[kind].number for kind in _BROKEN):
                break
            if feet := footing(model, data, self.base):
                ground = min(foot.pos[2] - foot.dist / 2.0 for foot in feet)  # a contact is midway between surfaces
                return float(ground), min(self.height, float(data.xpos[self.base, 2]))
            mujoco.mj_step2(model, data)
        return 0.0, self.height  # it hovers, falls for good or breaks apart

    @property
    def height(self) -> float:
        """[m] height of the base at the start."""
        assert self.base is not None
        return float(self._data.xpos[self.base, 2])

    @property
    def rises(self) -> bool:
        """Whether the robot as a whole moves up and down."""
        return self.base is not None and upwards(self.model, self.base) is not None

    @property
    def has_ground(self) -> bool:
        """Whether a fixed geom collides, so that it may be stood on, or gravity does not pull down."""
        model = self.model
        fixed = model.body_weldid[model.geom_bodyid] == 0
        stands = bool((fixed & ((model.geom_contype | model.geom_conaffinity) != 0)).any())
        return stands or model.opt.gravity[2] >= 0.0

    @property
    def can_stand(self) -> bool:
        """Whether the robot collides with a fixed geom, the model has contact pairs, or gravity does not pull down."""
        model = self.model
        fixed = model.body_weldid[model.geom_bodyid] == 0
        own = np.zeros_like(fixed) if self.base is None else model.body_rootid[model.geom_bodyid] == self.base
        kinds, others = model.geom_contype[:, None], model.geom_conaffinity[:, None]
        meets = (kinds[fixed] & others[own].T) | (others[fixed] & kinds[own].T)
        return bool(meets.any()) or model.npair > 0 or model.opt.gravity[2] >= 0.0

    @property
    def root(self) -> Point | None:
        """The base as a point; None for a robot that stands fixed."""
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
        return [place for place in found if name_of(model, place.kind, place.index)]

    def has_middle(self, place: Point) -> bool:
        """Whether a distance to its position means something: a plane or a height field is everywhere."""
        return place.kind != "GEOM" or int(self.model.geom_type[place.index]) not in _SHAPELESS

    def is_held(self, place: Point) -> bool:
        """Whether an equality ties joints that carry it, so that their positions alone do not say where it goes."""
        return bool(carrying(self.model, place.body) & looped(self.model))

    def mooring(self, place: Point) -> tuple[str, str] | None:
        """A body on the way to it that is tied to a mocap body, and the latter; None for none."""
        joints = carrying(self.model, place.body)
        tied = (pair for pair in moored(self.model) if carrying(self.model, pair[0]) & joints)
        return next(((self._called(body), self._called(mocap)) for body, mocap in tied), None)

    def moves(self, place: Point) -> bool:
        """Whether physics moves it: a mocap body stays where it is put."""
        whole = self.model.body_weldid[place.body]
        return bool(whole) and bool(self.model.body_mocapid[whole] < 0)

    def are_one(self, place: Point, other: Point) -> bool:
        """Whether the two cannot move relative to each other."""
        return bool(self.model.body_weldid[place.body] == self.model.body_weldid[other.body])

    def is_robots(self, place: Point) -> bool:
        """Whether actuators move it."""
        return self.moves(place) and int(self.model.body_treeid[place.body]) in driven_trees(self.model)

    def where(self, place: Point) -> np.ndarray:
        """(3,) position at the start [m]."""
        return getattr(self._data, place.field)[place.index].copy()

    def reach(self, place: Point, poses: int) -> np.ndarray:
        """(poses, 3) positions [m] of a part of the robot, for random positions of the driven joints."""
        random, pose, found = np.random.default_rng(0), self._home.copy(), []
        ranges = self._ranges()
        for _ in range(poses):
            for joint in self._driven:
                if joint in ranges:
                    pose[self.model.jnt_qposadr[joint]] = random.uniform(*ranges[joint])
            follow(self.model, pose)
            self._pose(pose)
            found.append(self.where(place))
        self._pose(self._home)
        return np.array(found)

    def _ranges(self) -> dict[int, np.ndarray]:
        """The range (2,) in which actions move each driven hinge and slide; a guessed -1 to 1 where there is none."""
        model, ranges = self.model, dict[int, np.ndarray]()
        for joint in self._driven:
            if model.jnt_type[joint] in (SLIDE, HINGE):
                ranges[joint] = model.jnt_range[joint] if is_bounded(model, joint) else np.array([-1.0, 1.0])
        for actuator in range(model.nu):
            if found := servo_range(model, actuator):
                joint, held = found
                ranges[joint] = held.clip(*ranges[joint]) if is_bounded(model, joint) else held
        return ranges

    def radius(self, place: Point) -> float:
        """[m] around the place that its colliding geoms fill; 0 for a mere mark."""
        if place.field == "site_xpos":
            return 0.0
        model = self.model
        of_body = np.flatnonzero(model.geom_bodyid == place.body).tolist()
        geoms = [place.index] if place.field == "geom_xpos" else of_body
        solid = [geom for geom in geoms if model.geom_contype[geom] or model.geom_conaffinity[geom]]
        centre = self.where(place)
        around = [float(np.linalg.norm(self._data.geom_xpos[g] - centre) + model.geom_rbound[g]) for g in solid]
        return max(around, default=0.0)

    def _ends(self) -> list[int]:
        """Ends of the limbs, those with the most driven joints before them first."""
        model, parents = self.model, set(self.model.body_parentid[1:].tolist())
        behind = {body: self.depth(body) for body in range(1, model.nbody) if body not in parents}
        ends = [body for body, count in behind.items() if count]
        return sorted(ends, key=lambda body: (-behind[body], body))[:MOST_LINKS]

    def depth(self, body: int) -> int:
        """Driven joints between a body and the world."""
        before = carrying(self.model, body)
        return sum(joint in before for joint in self._driven)

    def _objects(self) -> list[Point]:
        """Loose objects: bodies on a free or sliding joint that no actuator moves."""
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
