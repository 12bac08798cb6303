"""What the sensors of a model measure, as state variables of a draft show it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from ..tasks.anatomy import named
from ..types import StateUse


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
