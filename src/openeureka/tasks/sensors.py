"""What robots feel and where their bodies are, from MuJoCo's fields."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import torch
from torch import Tensor

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
