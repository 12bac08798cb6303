"""What robots feel and where their bodies are, from MuJoCo's fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import torch
from torch import Tensor

from ..types import StateUse
from .anatomy import named
from .rotations import rotate_inverse, xyzw

_CONTACT = 9  # numbers of one body's contact sensor: force, torque, point of attack, in the world frame
_FRAME = 7  # numbers of one body's frame sensors: position, quaternion


def add_contact_sensor(spec: mujoco.MjSpec, body: str, *fields: mujoco.mjtConDataField, on: str = "") -> None:
    """Add a sensor of these parts of the net contact wrench, in the world frame, that a body exerts on another, or on
    all that it touches. The body feels the negative of it."""
    net_force = 3  # reduction of all contacts to one wrench
    spec.add_sensor(
        name=f"{body}_contact",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        objname=body,
        reftype=mujoco.mjtObj.mjOBJ_BODY if on else mujoco.mjtObj.mjOBJ_UNKNOWN,
        refname=on,
        intprm=[sum(1 << int(field) for field in fields), net_force, 1],
    )


def add_wrench_sensors(spec: mujoco.MjSpec, bodies: Sequence[str]) -> None:
    """Sensors in the order that `contact_wrenches` reads: every contact, then every frame."""
    field = mujoco.mjtConDataField
    for body in bodies:
        add_contact_sensor(spec, body, field.mjCONDATA_FORCE, field.mjCONDATA_TORQUE, field.mjCONDATA_POS)
    for body in bodies:
        for kind in (mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtSensor.mjSENS_FRAMEQUAT):
            spec.add_sensor(name=f"{body}_{kind.name}", type=kind, objtype=mujoco.mjtObj.mjOBJ_XBODY, objname=body)


def contact_wrenches(readings: Tensor, bodies: int) -> Tensor:
    """Net contact force and torque (N, bodies, 6) on each body, about and in its frame.

    Isaac Gym's sensors also contain the loads of the joint; these are zero in the air. Forces are those of the last
    substep, seen in the frame after it.

    Args:
        readings: `sensordata` (N, S) of a model whose first sensors are those of `add_wrench_sensors`.
    """
    contact = readings[:, : bodies * _CONTACT].view(-1, bodies, 3, 3)
    frame = readings[:, bodies * _CONTACT : bodies * (_CONTACT + _FRAME)].view(-1, bodies, _FRAME)
    force, torque, point = contact.unbind(-2)
    torque = torque + torch.linalg.cross(point - frame[..., :3], force)
    quat = xyzw(frame[..., 3:]).unsqueeze(-2)
    on_body = -torch.stack((force, torque), dim=-2)  # the sensor gives what the body does to the world
    return rotate_inverse(quat, on_body).flatten(-2)


def body_states(xpos: Tensor, xquat: Tensor, cvel: Tensor, centre: Tensor) -> Tensor:
    """States (N, B, 13) of bodies in the world frame: position, quaternion, velocity of the origin, angular velocity.

    Args:
        xpos, xquat, cvel: MuJoCo's fields of these bodies.
        centre: `subtree_com` of their roots, the point that `cvel` refers to.
    """
    angular, linear = cvel.split(3, dim=-1)
    velocity = linear + torch.linalg.cross(angular, xpos - centre)
    return torch.cat((xpos, xyzw(xquat), velocity, angular), dim=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One sensor of a model, as a state variable may show it."""

    index: int
    name: str
    meaning: str
    size: int
    use: StateUse
    quaternion: bool
    """Whether it is a quaternion w, x, y, z."""
    felt: bool
    """Whether it tells what positions and velocities of joints and bodies do not."""


# Quantity, use, felt. Sensors that are not here get their values from a user's or a plugin's code.
_QUANTITIES: dict[str, tuple[str, StateUse, bool]] = {
    "TOUCH": ("normal force that presses on {} [N]", "directional", True),
    "ACCELEROMETER": ("acceleration at {}, in its frame, gravity included [m/s^2]", "raw", True),
    "VELOCIMETER": ("velocity of {}, in its frame [m/s]", "zero_centred", True),
    "GYRO": ("angular velocity of {}, in its frame [rad/s]", "zero_centred", True),
    "FORCE": ("force between the body of {} and its parent, in the frame of {} [N]", "raw", True),
    "TORQUE": ("torque between the body of {} and its parent, in the frame of {} [N m]", "raw", True),
    "MAGNETOMETER": ("magnetic field at {}, in its frame", "raw", True),
    "RANGEFINDER": ("distance from {} to what is before it [m], -1 for nothing", "raw", True),
    "CAMPROJECTION": ("where {} is in the picture of a camera [pixel]", "raw", False),
    "JOINTPOS": ("position of joint {} [rad or m]", "raw", False),
    "JOINTVEL": ("velocity of joint {} [rad/s or m/s]", "zero_centred", False),
    "TENDONPOS": ("length of tendon {}", "raw", False),
    "TENDONVEL": ("velocity of tendon {}", "zero_centred", False),
    "ACTUATORPOS": ("length of actuator {}", "raw", False),
    "ACTUATORVEL": ("velocity of actuator {}", "zero_centred", False),
    "ACTUATORFRC": ("force of actuator {} [N or N m]", "zero_centred", False),
    "JOINTACTFRC": ("force of all actuators on joint {} [N or N m]", "zero_centred", False),
    "TENDONACTFRC": ("force of all actuators on tendon {} [N]", "zero_centred", False),
    "BALLQUAT": ("orientation of ball joint {}, quaternion x, y, z, w", "raw", False),
    "BALLANGVEL": ("angular velocity of ball joint {} [rad/s]", "zero_centred", False),
    "JOINTLIMITPOS": ("how far joint {} is from its limit [rad or m]", "raw", False),
    "JOINTLIMITVEL": ("velocity of joint {} at its limit [rad/s or m/s]", "raw", False),
    "JOINTLIMITFRC": ("force of the limit of joint {} [N or N m]", "raw", False),
    "TENDONLIMITPOS": ("how far tendon {} is from its limit", "raw", False),
    "TENDONLIMITVEL": ("velocity of tendon {} at its limit", "raw", False),
    "TENDONLIMITFRC": ("force of the limit of tendon {} [N]", "raw", False),
    "FRAMEPOS": ("position of {} [m]", "point", False),
    "FRAMEQUAT": ("orientation of {}, quaternion x, y, z, w", "raw", False),
    "FRAMEXAXIS": ("x axis of {}", "raw", False),
    "FRAMEYAXIS": ("y axis of {}", "raw", False),
    "FRAMEZAXIS": ("z axis of {}", "raw", False),
    "FRAMELINVEL": ("velocity of {} [m/s]", "zero_centred", False),
    "FRAMEANGVEL": ("angular velocity of {} [rad/s]", "zero_centred", False),
    "FRAMELINACC": ("acceleration of {} [m/s^2]", "raw", False),
    "FRAMEANGACC": ("angular acceleration of {} [rad/s^2]", "raw", False),
    "SUBTREECOM": ("centre of mass of {} and all that hangs on it [m]", "point", False),
    "SUBTREELINVEL": ("velocity of the centre of mass of {} and all that hangs on it [m/s]", "zero_centred", False),
    "SUBTREEANGMOM": ("angular momentum of {} and all that hangs on it [kg m^2/s]", "zero_centred", False),
    "INSIDESITE": ("1 while {} is inside a site, else 0", "directional", True),
    "GEOMDIST": ("distance of {} to another [m]", "raw", True),
    "GEOMNORMAL": ("direction from {} to another", "raw", False),
    "GEOMFROMTO": ("nearest points of {} and another [m]", "raw", False),
    "CONTACT": ("contact of {}", "raw", True),
    "TACTILE": ("pressure and sliding on {}", "raw", True),
    "E_POTENTIAL": ("potential energy [J]", "raw", False),
    "E_KINETIC": ("kinetic energy [J]", "raw", False),
    "CLOCK": ("time since the start [s]", "raw", False),
}


def readings(model: mujoco.MjModel) -> list[Reading]:
    """What the sensors of a model measure, in its order."""
    found: list[Reading] = []
    for sensor in range(model.nsensor):
        kind = mujoco.mjtSensor(model.sensor_type[sensor]).name.removeprefix("mjSENS_")
        if kind not in _QUANTITIES:
            continue
        meaning, use, felt = _QUANTITIES[kind]
        of = _object(model, model.sensor_objtype[sensor], model.sensor_objid[sensor])
        if model.sensor_refid[sensor] >= 0:
            to = _object(model, model.sensor_reftype[sensor], model.sensor_refid[sensor])
            meaning += f", seen from {to}" if kind.startswith("FRAME") else f": {to}"
        size = int(model.sensor_dim[sensor])
        found.append(
            Reading(
                index=sensor,
                name=named(model, "SENSOR", sensor),
                meaning=meaning.replace("{}", of),
                size=size,
                use="raw" if use == "point" and model.sensor_refid[sensor] >= 0 else use,
                quaternion=kind.endswith("QUAT"),
                felt=felt,
            )
        )
    return found


def _object(model: mujoco.MjModel, kind: int, index: int) -> str:
    """What an object is called; MuJoCo's `body` is the frame of its inertia, `xbody` that of its joints and geoms."""
    if index < 0:
        return "the model"
    called = mujoco.mjtObj(kind).name.removeprefix("mjOBJ_")
    inertial = "the inertial frame of " if called == "BODY" else ""
    return inertial + named(model, called.removeprefix("X") if called == "XBODY" else called, index)
