"""The simulator's state, read from MuJoCo itself, and the originals' arithmetic in NumPy, in double precision.

The code under test serves only to make worlds and to put them into a state.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import torch

from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make
from openeureka.types import StateSpec

Array = np.ndarray


def unit(value: Array) -> Array:
    return value / np.linalg.norm(value, axis=-1, keepdims=True)


def mul(a: Array, b: Array) -> Array:
    """Product of quaternions x, y, z, w: the rotation by b, then by a."""
    a, b = np.broadcast_arrays(a, b)
    (ax, ay, az, aw), (bx, by, bz, bw) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack(
        (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ),
        axis=-1,
    )


def conj(quat: Array) -> Array:
    return quat * np.array([-1.0, -1.0, -1.0, 1.0])


def turn(quat: Array, vector: Any) -> Array:
    """Vectors turned by quaternions."""
    vector = np.asarray(vector, dtype=float)
    pure = np.concatenate((vector, np.zeros((*vector.shape[:-1], 1))), axis=-1)
    return mul(mul(quat, pure), conj(quat))[..., :3]


def about(axis: Any, angle: Any) -> Array:
    half = np.asarray(angle, dtype=float)[..., None] / 2
    return np.concatenate((np.asarray(axis, dtype=float) * np.sin(half), np.cos(half)), axis=-1)


def euler(a: float, b: float, c: float) -> Array:
    """E(a, b, c) of the originals: Rz(c) Ry(b) Rx(a)."""
    return mul(about((0, 0, 1), c), mul(about((0, 1, 0), b), about((1, 0, 0), a)))


def angle_between(a: Array, b: Array) -> Array:
    """2 asin(min(1, |vector part of a conj(b)|))."""
    return 2 * np.arcsin(np.minimum(1.0, np.linalg.norm(mul(a, conj(b))[..., :3], axis=-1)))


def norm(value: Array) -> Array:
    return np.linalg.norm(value, axis=-1)


def to_unit_range(q: Array, lower: Array, upper: Array) -> Array:
    """`unscale` of the originals: [lower, upper] to [-1, 1]."""
    return (2 * q - upper - lower) / (upper - lower)


def prepared(env: str, worlds: int, steps: int = 3, seed: int = 3) -> BatchedEnv:
    """Worlds a few random steps after their start, with everything in motion."""
    simulation = make(env, worlds=worlds, lane_seeds=(seed,), threads=1)
    simulation.reset()
    generator = torch.Generator().manual_seed(seed)
    for _ in range(steps):
        simulation.step(torch.rand(worlds, simulation.task.num_actions, generator=generator) * 2 - 1)
    return simulation


def put(simulation: BatchedEnv, joints: Mapping[str, Array]) -> None:
    """Write joint positions (N, .) (of a free joint: position, quaternion x y z w); update what follows from them."""
    qpos = simulation.sim.bind("qpos")
    for name, value in joints.items():
        start = int(simulation.sim.model.joint(name).qposadr[0])
        if value.shape[-1] == 7:
            value = np.concatenate((value[:, :3], value[:, 6:], value[:, 3:6]), axis=-1)
        qpos[:, start : start + value.shape[-1]] = torch.from_numpy(np.ascontiguousarray(value)).float()
    simulation.sim.forward(torch.arange(simulation.num_worlds))


class Worlds:
    """MuJoCo's own data of every world."""

    def __init__(self, simulation: BatchedEnv) -> None:
        self.count = simulation.num_worlds
        shots = [simulation.sim.snapshot(world) for world in range(self.count)]
        self.model = shots[0][0]
        self.data = [data for _, data in shots]

    def field(self, name: str) -> Array:
        return np.stack([np.array(getattr(data, name)) for data in self.data])

    def body(self, name: str) -> Array:
        """(N, 13): position, quaternion x y z w, velocity of the origin, angular velocity, in the world's axes."""
        index = self.model.body(name).id
        states = []
        for data in self.data:
            velocity = np.zeros(6)  # angular, then linear, at the body's origin
            mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_XBODY, index, velocity, 0)
            quat = data.xquat[index][[1, 2, 3, 0]]
            states.append(np.concatenate((data.xpos[index], quat, velocity[3:], velocity[:3])))
        return np.stack(states)

    def angle(self, joint: str) -> Array:
        """(N,) Position of a hinge or slide."""
        return self.field("qpos")[:, self.model.joint(joint).qposadr[0]]

    def rate(self, joint: str) -> Array:
        return self.field("qvel")[:, self.model.joint(joint).dofadr[0]]

    def drive(self, joint: str) -> Array:
        """(N,) force of the actuators on a joint."""
        return self.field("qfrc_actuator")[:, self.model.joint(joint).dofadr[0]]

    def wrench(self, body: str) -> Array:
        """(N, 6): force and torque of all contacts on a body about its origin, in its frame."""
        index = self.model.body(body).id
        found = np.zeros((self.count, 6))
        for world, data in enumerate(self.data):
            rotation = data.xmat[index].reshape(3, 3)
            for number in range(data.ncon):
                contact = data.contact[number]
                bodies = self.model.geom_bodyid[contact.geom]
                if index not in bodies:
                    continue
                local = np.zeros(6)
                mujoco.mj_contactForce(self.model, data, number, local)
                axes = contact.frame.reshape(3, 3).T
                sign = 1.0 if bodies[1] == index else -1.0  # MuJoCo gives the force on the second geom
                force, torque = sign * axes @ local[:3], sign * axes @ local[3:]
                torque = torque + np.cross(contact.pos - data.xpos[index], force)
                found[world] += np.concatenate((rotation.T @ force, rotation.T @ torque))
        return found


def differences(
    spec: StateSpec, found: Mapping[str, Any], expected: Mapping[str, Any], tolerance: Mapping[str, float] | None = None
) -> list[str]:
    """State variables that are missing, not expected, or of other values than expected. A quaternion may have either
    sign."""
    wrong = [f"{name} is not expected" for name in spec.names if name not in expected and name != "obs_buf"]
    for name, value in expected.items():
        if name not in found:
            wrong.append(f"{name} is missing")
            continue
        got = found[name].double().numpy() if isinstance(found[name], torch.Tensor) else np.asarray(found[name])
        value = np.asarray(value, dtype=float)
        if got.shape != value.shape:
            wrong.append(f"{name} is {got.shape}, not {value.shape}")
            continue
        if name.rpartition("_")[2] in ("rot", "quats", "pose", "state", "states", "tensor"):
            got = same_signs(got, value)
        limit = (tolerance or {}).get(name, 2e-5)
        away = np.abs(got - value) / np.maximum(1.0, np.abs(value))
        if away.size and away.max() > limit:
            place = np.unravel_index(away.argmax(), away.shape)
            wrong.append(f"{name}{list(map(int, place))} is {got[place]:.6f}, not {value[place]:.6f}")
    return wrong


def same_signs(got: Array, value: Array) -> Array:
    """`got`, but quaternions in the columns of a pose or state have the signs of those in `value`."""
    width = value.shape[-1] if value.ndim > 1 else 0
    columns = {4: slice(0, 4), 7: slice(3, 7), 13: slice(3, 7)}.get(width)
    if columns is None:
        return got
    sign = np.sign((got[..., columns] * value[..., columns]).sum(axis=-1, keepdims=True))
    got = got.copy()
    got[..., columns] *= np.where(sign == 0, 1, sign)
    return got
