"""Quaternions x, y, z, w, in the last axis."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor


def xyzw(wxyz: Tensor) -> Tensor:
    """MuJoCo's order to the order every state variable uses."""
    return wxyz.roll(-1, -1)


def wxyz(xyzw: Tensor) -> Tensor:
    """The order of every state variable to MuJoCo's."""
    return xyzw.roll(1, -1)


def rotate(quat: Tensor, vector: Tensor) -> Tensor:
    """Turn body-frame vectors (..., 3) into the world frame; leading axes broadcast."""
    axis, vector = torch.broadcast_tensors(quat[..., :3], vector)
    w = quat[..., 3:]
    cross = 2.0 * torch.linalg.cross(axis, vector)
    return vector + w * cross + torch.linalg.cross(axis, cross)


def rotate_inverse(quat: Tensor, vector: Tensor) -> Tensor:
    """Turn world-frame vectors (..., 3) into the body frame; leading axes broadcast."""
    axis, vector = torch.broadcast_tensors(quat[..., :3], vector)
    w = quat[..., 3:]
    cross = 2.0 * torch.linalg.cross(axis, vector)
    return vector - w * cross + torch.linalg.cross(axis, cross)


def multiply(a: Tensor, b: Tensor) -> Tensor:
    """The turn by b, then by a; leading axes broadcast."""
    u, v = torch.broadcast_tensors(a[..., :3], b[..., :3])
    s, t = a[..., 3:], b[..., 3:]
    vector = s * v + t * u + torch.linalg.cross(u, v)
    return torch.cat((vector, s * t - (u * v).sum(dim=-1, keepdim=True)), dim=-1)


def conjugate(quat: Tensor) -> Tensor:
    """The opposite turn, of a unit quaternion."""
    return torch.cat((-quat[..., :3], quat[..., 3:]), dim=-1)


def turn_about(axis: Literal[0, 1, 2], angle: Tensor) -> Tensor:
    """The turn (..., 4) by angles (...) [rad] about the x, y or z axis."""
    turn = angle.new_zeros((*angle.shape, 4))
    turn[..., axis], turn[..., 3] = (0.5 * angle).sin(), (0.5 * angle).cos()
    return turn


def rotation_distance(a: Tensor, b: Tensor) -> Tensor:
    """Angle in [0, pi] between orientations (..., 4)."""
    vector = multiply(a, conjugate(b))[..., :3]
    return 2.0 * torch.asin(torch.linalg.vector_norm(vector, dim=-1).clamp(max=1.0))


def tumble(turns: Tensor) -> Tensor:
    """A turn about y, then one about x (..., 2: x, y), each from -1 to 1 half turns.

    The originals draw orientations so; they are not uniform over rotations.
    """
    half = 0.5 * torch.pi * turns
    (sin_x, sin_y), (cos_x, cos_y) = half.sin().unbind(-1), half.cos().unbind(-1)
    return torch.stack((sin_x * cos_y, cos_x * sin_y, sin_x * sin_y, cos_x * cos_y), dim=-1)


def euler_xyz(quat: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Roll, pitch, yaw [rad], each wrapped to [0, 2 pi) as Isaac Gym's helper returns them."""
    x, y, z, w = quat.unbind(-1)
    roll = torch.atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z)
    pitch = torch.asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0))
    yaw = torch.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    full = 2.0 * torch.pi
    return roll % full, pitch % full, yaw % full


def root_state(qpos: Tensor, qvel: Tensor) -> Tensor:
    """State (N, 13) of the free joint in the first columns, in the world frame: position, quaternion, linear velocity,
    angular velocity (which MuJoCo gives in the body frame)."""
    quat = xyzw(qpos[:, 3:7])
    return torch.cat((qpos[:, :3], quat, qvel[:, :3], rotate(quat, qvel[:, 3:6])), dim=-1)
