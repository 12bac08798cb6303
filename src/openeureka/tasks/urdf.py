"""Reads a robot description (URDF) as a MuJoCo model. A URDF has no actuators, and names meshes as ROS packages do."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from ..errors import TaskError
from .anatomy import HINGE, follow, scalar_joints
from .start import home

STIFFNESS = 4.0
"""[1/rad] or [1/m]: servos of joints with a range give their full effort at an error of 0.25 rad or m."""
POSES = 50
"""Random poses, besides the one at the start, in all of which two links overlap that never collide."""
_MESHES = (".stl", ".obj", ".msh")
_DRIVEN = ("revolute", "continuous", "prismatic")
"""Types of joints that a motor may move."""
_LEAST = 1e-6
"""[kg], [kg m^2] that MuJoCo needs for anything that moves; URDFs leave out the inertia of mere frames."""


def read_urdf(path: str | Path, *, floating: bool = False) -> mujoco.MjSpec:
    """The robot with an actuator for every joint that has an effort limit.

    A joint with a range gets a position servo within that range, and a joint without a range gets a motor. Both are
    limited to its effort. Its damping is such that full effort moves it at its velocity limit. Joints that mimic
    another follow it. Links that a joint connects do not collide, nor do links that overlap in every pose. Visual
    meshes in formats that MuJoCo cannot read are left out.

    Args:
        floating: let the root move freely, above a floor, as a joint of type `floating` does too; else it is fixed to
            the world, as arms are.

    Raises:
        TaskError: when it is no URDF, a mesh that collides is missing or unreadable, no joint can move or has an effort
            limit, or one mimics a joint that does not exist.
    """
    path = Path(path).resolve()
    if not path.is_file():
        raise TaskError(f"There is no file {path}; name a MuJoCo XML file or a URDF, for example model=hopper.xml.")
    try:
        robot = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise TaskError(f"{path} is not readable XML: {error}.") from None
    if robot.tag != "robot" or robot.find("link") is None:
        raise TaskError(f"{path} is not a URDF: it begins with <{robot.tag}> instead of a <robot> with links.")
    for link in robot.iter("link"):
        _find_meshes(link, path)
    for extension in robot.findall("mujoco"):
        robot.remove(extension)
    settings = {"strippath": "false", "discardvisual": "false", "fusestatic": "false", "balanceinertia": "true"}
    least = {"boundmass": str(_LEAST), "boundinertia": str(_LEAST)}
    ElementTree.SubElement(ElementTree.SubElement(robot, "mujoco"), "compiler", settings | least)
    try:
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(robot, encoding="unicode"))
    except (ValueError, mujoco.FatalError) as error:
        raise _unreadable(path, error) from None
    _actuate(spec, robot)
    if not spec.actuators and not any(joint.get("type") in _DRIVEN for joint in robot.iter("joint")):
        raise TaskError(
            f"{path} has no joint that a motor could move; a drone's propellers need a MuJoCo model with a motor at a "
            "site."
        )
    if not spec.actuators:
        raise TaskError(
            f"No joint of {path} has a <limit> with an effort above zero, so the robot has no actuators; add such "
            "limits."
        )
    afloat = floating or _floats(spec)
    if not afloat:
        _part_from_base(spec)
    elif not _floats(spec):
        spec.worldbody.first_body().add_freejoint()
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise _unreadable(path, error) from None
    _part_overlapping(spec, model)
    if afloat:
        _put_on_floor(spec, model)
    return spec


def _unreadable(path: Path, error: Exception) -> TaskError:
    return TaskError(f"MuJoCo cannot read {path}: {' '.join(str(error).split())}.")


def _find_meshes(link: ElementTree.Element, path: Path) -> None:
    """Write where a link's meshes are into it, and drop visual shapes that MuJoCo cannot read."""
    for kind in ("visual", "collision"):
        for part in link.findall(kind):
            mesh = part.find("geometry/mesh")
            if mesh is None:
                if kind == "visual" and _is_empty(part):
                    link.remove(part)
                continue
            name = mesh.get("filename", "")
            found = _mesh(name, path)
            if found is not None and found.suffix.lower() in _MESHES and not _is_text(found):
                mesh.set("filename", str(found))
            elif kind == "visual":
                link.remove(part)
            elif found is None:
                raise TaskError(
                    f"The collision mesh {name} of {path} is neither in its folder nor in one above it; put it there."
                )
            else:
                raise TaskError(f"MuJoCo cannot read the collision mesh {name} of {path}; convert it to a binary STL.")


def _is_empty(part: ElementTree.Element) -> bool:
    """Whether a shape has a length of zero."""
    shapes = part.iterfind("geometry/*")
    lengths = (size for shape in shapes for key in ("radius", "length", "size") for size in shape.get(key, "1").split())
    return any(re.fullmatch(r"0*\.?0*", length) for length in lengths)


def _is_text(mesh: Path) -> bool:
    """Whether an STL is written as text, which MuJoCo does not read. Binary ones may begin with `solid` too, but have a
    length of 84 bytes and 50 for each triangle."""
    with mesh.open("rb") as file:
        head = file.read(84)
    binary = len(head) == 84 and mesh.stat().st_size == 84 + 50 * int.from_bytes(head[80:], "little")
    return mesh.suffix.lower() == ".stl" and head.lstrip().startswith(b"solid") and not binary


def _mesh(name: str, path: Path) -> Path | None:
    """Where a mesh is: `package://NAME/...` is looked for beside and in every folder above the description."""
    _, package, inside = name.rpartition("package://")
    if not package:
        place = path.parent / name.removeprefix("file://")
        return place if place.is_file() else None
    _, _, rest = inside.partition("/")
    for folder in path.parents:
        for place in (folder / inside, folder / rest):
            if place.is_file():
                return place
    return None


def _actuate(spec: mujoco.MjSpec, robot: ElementTree.Element) -> None:
    to_joint = {"trntype": mujoco.mjtTrn.mjTRN_JOINT}
    names = {joint.get("name", "") for joint in robot.iter("joint")}
    for joint in robot.iter("joint"):
        name, limit, mimic = joint.get("name", ""), joint.find("limit"), joint.find("mimic")
        if mimic is not None and mimic.get("joint", "") not in names:
            raise TaskError(
                f"Joint {name} mimics {mimic.get('joint', '')!r:.60}, which is not a joint; correct its name."
            )
        # A joint that mimics another is held to it by an equality, which MuJoCo's own reader adds.
        if joint.get("type") not in _DRIVEN or mimic is not None:
            continue
        low, high, effort, speed = (_number(limit, key, name) for key in ("lower", "upper", "effort", "velocity"))
        if effort <= 0.0:
            continue
        actuator = spec.add_actuator(name=name, target=name, ctrllimited=1, **to_joint)
        if joint.get("type") != "continuous" and low < high:
            actuator.set_to_position(kp=STIFFNESS * effort, dampratio=1.0)
            actuator.ctrlrange = [low, high]
            actuator.forcelimited, actuator.forcerange = 1, [-effort, effort]
        else:
            actuator.gear[0], actuator.ctrlrange = effort, [-1.0, 1.0]
        if speed > 0.0:
            spec.joint(name).damping[0] = max(spec.joint(name).damping[0], effort / speed)


def _number(limit: ElementTree.Element | None, key: str, joint: str) -> float:
    """A number of a limit; 0 where it is missing. Raises TaskError where it is no number, or not finite."""
    said = limit.get(key, "0") if limit is not None else "0"
    try:
        value = float(said)
    except ValueError:
        raise TaskError(f"The limit {key}={said!r:.40} of joint {joint} is not a number; correct it.") from None
    if math.isfinite(value) or (key == "velocity" and value > 0.0):  # infinite: no damping
        return value
    raise TaskError(f"The limit {key}={said!r:.40} of joint {joint} is not finite; write a finite number.")


def _part_from_base(spec: mujoco.MjSpec) -> None:
    """Exclude contacts of the base with the first links on it; MuJoCo does so itself only where a base is not fixed."""
    fixed, first = {spec.worldbody.name}, set[str]()
    for body in spec.bodies[1:]:  # parents come before their children
        same = fixed if body.parent.name in fixed else first if body.parent.name in first else set[str]()
        if not body.joints:
            same.add(body.name)
        elif same is fixed:
            first.add(body.name)
    base, carried = ([body.name for body in spec.bodies if body.name in of and body.geoms] for of in (fixed, first))
    for one in base:
        for other in carried:
            spec.add_exclude(bodyname1=one, bodyname2=other)


def _part_overlapping(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Exclude contacts of links that overlap whatever the pose: they would push each other apart without end."""
    random, data, pose = np.random.default_rng(0), mujoco.MjData(model), home(model)
    pairs = _overlapping(model, data, pose)
    for _ in range(POSES):
        if not pairs:
            return
        for joint in scalar_joints(model):
            turn = math.pi if model.jnt_type[joint] == HINGE else 0.0
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-turn, turn)
            pose[model.jnt_qposadr[joint]] = random.uniform(low, high)
        follow(model, pose)
        pairs &= _overlapping(model, data, pose)
    for one, other in sorted(pairs):
        spec.add_exclude(bodyname1=model.body(one).name, bodyname2=model.body(other).name)


def _overlapping(model: mujoco.MjModel, data: mujoco.MjData, pose: np.ndarray) -> set[tuple[int, int]]:
    """Pairs of bodies that are inside each other at `qpos` (nq,)."""
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    deep = data.contact.geom[data.contact.dist < 0.0]
    return {(min(pair), max(pair)) for pair in model.geom_bodyid[deep].tolist()}


def _floats(spec: mujoco.MjSpec) -> bool:
    """Whether the description itself lets its root move freely."""
    root = spec.worldbody.first_body()
    return root is not None and any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in root.joints)


def _put_on_floor(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Put the robot onto a floor, in the pose in which episodes begin."""
    root, data = spec.worldbody.first_body(), mujoco.MjData(model)
    data.qpos[:] = home(model)
    mujoco.mj_kinematics(model, data)
    lowest: list[float] = []
    for geom in range(model.ngeom):
        centre, half = model.geom_aabb[geom].reshape(2, 3)
        turn = data.geom_xmat[geom].reshape(3, 3)
        lowest.append(float(data.geom_xpos[geom, 2] + (turn @ centre)[2] - abs(turn[2]) @ half))
    root.pos = [0.0, 0.0, root.pos[2] - min(lowest, default=0.0)]
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.1])
