"""Rotation and vector helpers for reward programs, under the names of Isaac Gym and IsaacGymEnvs.

Quaternions are (x, y, z, w), batched in the leading dimensions. Formulas: Diebel, "Representing attitude" (2006), with
the conventions that published rewards rely on (`get_euler_xyz` wraps to [0, 2 pi)). All functions are pure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import torch
from torch import Tensor

_TINY = 1e-9


def to_torch(x: object, dtype: torch.dtype = torch.float, device: object = None, requires_grad: bool = False) -> Tensor:
    """A tensor of literal numbers; `device` and `requires_grad` are accepted for compatibility and have no effect."""
    return tensor_of(x, dtype=dtype)


def tensor_of(data: Any, **options: Any) -> Tensor:
    """`torch.as_tensor` that stacks lists of tensors. torch's own reads out their numbers, which tracing cannot see."""
    if isinstance(data, list | tuple) and holds_tensor(cast(object, data)):
        return torch.stack([tensor_of(part, **options) for part in cast(Sequence[object], data)])
    return torch.as_tensor(data, **options)


def holds_tensor(data: object) -> bool:
    """Whether `data` is a tensor, or a list or tuple with a tensor in it at any depth."""
    if isinstance(data, list | tuple):
        return any(map(holds_tensor, cast(Sequence[object], data)))
    return isinstance(data, Tensor)


def norm(x: Tensor, p: float = 2, dim: int = -1) -> Tensor:
    return x.norm(p=p, dim=dim)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]


def _broadcast(a: Tensor, b: Tensor) -> tuple[Tensor, Tensor]:
    return torch.broadcast_tensors(a, b)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]


# --- vectors and angles ----------------------------------------------------------------------------------------------


def normalize(x: Tensor, eps: float = _TINY) -> Tensor:
    return x / norm(x).clamp(min=eps).unsqueeze(-1)


def normalize_angle(x: Tensor) -> Tensor:
    """Wrap to [-pi, pi]."""
    return torch.atan2(torch.sin(x), torch.cos(x))


def wrap_to_pi(angles: Tensor) -> Tensor:
    """Wrap to (-pi, pi]."""
    wrapped = angles % (2 * math.pi)
    return wrapped - 2 * math.pi * (wrapped > math.pi)


def copysign(a: float, b: Tensor) -> Tensor:
    """|a| with the sign of b; 0 where b is 0."""
    return abs(a) * torch.sign(b)


def tensor_clamp(t: Tensor, min_t: Tensor, max_t: Tensor) -> Tensor:
    return torch.max(torch.min(t, max_t), min_t)


def saturate(x: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    return torch.max(torch.min(x, upper), lower)


def scale(x: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """[-1, 1] to [lower, upper]."""
    return 0.5 * (x + 1.0) * (upper - lower) + lower


def unscale(x: Tensor, lower: Tensor, upper: Tensor) -> Tensor:
    """[lower, upper] to [-1, 1]."""
    return (2.0 * x - upper - lower) / (upper - lower)


# IsaacGymEnvs' `scale_transform` maps to [-1, 1], as `unscale` does, and its `unscale_transform` maps back.
unscale_np = scale_transform = unscale
unscale_transform = scale


def get_axis_params(
    value: float, axis_idx: int, x_value: float = 0.0, dtype: type = float, n_dims: int = 3
) -> list[float]:
    """A vector with `value` at `axis_idx` and 0 elsewhere, but its first number is always `x_value`."""
    params = [dtype(value) if axis == axis_idx else dtype(0) for axis in range(n_dims)]
    params[0] = dtype(x_value)
    return params


# --- quaternions -----------------------------------------------------------------------------------------------------


def quat_unit(a: Tensor) -> Tensor:
    return normalize(a)


def quat_conjugate(a: Tensor) -> Tensor:
    return torch.cat((-a[..., :3], a[..., 3:]), dim=-1)


def quat_mul(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton product a b: rotate by b, then by a."""
    a, b = _broadcast(a, b)
    a_vec, a_w, b_vec, b_w = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    vec = a_w * b_vec + b_w * a_vec + torch.cross(a_vec, b_vec, dim=-1)
    w = a_w * b_w - (a_vec * b_vec).sum(dim=-1, keepdim=True)
    return torch.cat((vec, w), dim=-1)


def quat_apply(a: Tensor, b: Tensor) -> Tensor:
    """Rotate vectors b by unit quaternions a."""
    vec, b = _broadcast(a[..., :3], b)
    twice = 2.0 * torch.cross(vec, b, dim=-1)
    return b + a[..., 3:] * twice + torch.cross(vec, twice, dim=-1)


def quat_rotate(q: Tensor, v: Tensor) -> Tensor:
    """Rotate vectors v by q. Same as `quat_apply` for unit quaternions; for others, as Isaac Gym's `quat_rotate`."""
    vec, v = _broadcast(q[..., :3], v)
    w = q[..., 3:]
    along = (vec * v).sum(dim=-1, keepdim=True)
    return (2.0 * w * w - 1.0) * v + 2.0 * w * torch.cross(vec, v, dim=-1) + 2.0 * along * vec


my_quat_rotate = get_basis_vector = quat_rotate


def quat_rotate_inverse(q: Tensor, v: Tensor) -> Tensor:
    """Rotate vectors v by the inverse of q: from the world frame into the frame of a body with orientation q."""
    return quat_rotate(quat_conjugate(q), v)


def quat_from_angle_axis(angle: Tensor, axis: Tensor) -> Tensor:
    half = (0.5 * angle).unsqueeze(-1)
    return quat_unit(torch.cat((normalize(axis) * half.sin(), half.cos()), dim=-1))


def quat_diff_rad(a: Tensor, b: Tensor) -> Tensor:
    """Angle [rad] of the rotation between two orientations."""
    difference = quat_mul(a, quat_conjugate(b))
    return 2.0 * torch.asin(torch.clamp(norm(difference[..., :3]), max=1.0))


def quat_axis(q: Tensor, axis: int = 0) -> Tensor:
    """World direction of a body axis."""
    return quat_rotate(q, torch.eye(3, dtype=q.dtype, device=q.device)[axis])


def quat_apply_yaw(quat: Tensor, vec: Tensor) -> Tensor:
    """Rotate by the yaw part of the orientation only."""
    return quat_apply(normalize(torch.cat((torch.zeros_like(quat[..., :2]), quat[..., 2:]), dim=-1)), vec)


def quat_to_tan_norm(q: Tensor) -> Tensor:
    """World directions of the body's x and z axes, (..., 6)."""
    return torch.cat((quat_axis(q, 0), quat_axis(q, 2)), dim=-1)


def slerp(q0: Tensor, q1: Tensor, t: Tensor) -> Tensor:
    """Spherical interpolation along the shorter arc; t has a trailing dimension of 1."""
    cosine = (q0 * q1).sum(dim=-1, keepdim=True)
    q1 = torch.where(cosine < 0, -q1, q1)
    cosine = cosine.abs().clamp(max=1.0)
    angle, sine = torch.acos(cosine), torch.sqrt(1.0 - cosine * cosine)
    safe = sine.clamp(min=1e-3)
    curved = torch.sin((1.0 - t) * angle) / safe * q0 + torch.sin(t * angle) / safe * q1
    return torch.where(sine < 1e-3, normalize((1.0 - t) * q0 + t * q1), curved)


# --- Euler angles, headings, exponential maps ------------------------------------------------------------------------


def get_euler_xyz(q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Roll, pitch and yaw [rad], each in [0, 2 pi)."""
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    roll = torch.atan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z)
    pitch = torch.asin(torch.clamp(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = torch.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return roll % (2 * math.pi), pitch % (2 * math.pi), yaw % (2 * math.pi)


def quat_from_euler_xyz(roll: Tensor, pitch: Tensor, yaw: Tensor) -> Tensor:
    """Inverse of `get_euler_xyz`: rotate about x by roll, then y by pitch, then z by yaw."""
    cr, sr = torch.cos(0.5 * roll), torch.sin(0.5 * roll)
    cp, sp = torch.cos(0.5 * pitch), torch.sin(0.5 * pitch)
    cy, sy = torch.cos(0.5 * yaw), torch.sin(0.5 * yaw)
    x = cy * sr * cp - sy * cr * sp
    y = cy * cr * sp + sy * sr * cp
    z = sy * cr * cp - cy * sr * sp
    w = cy * cr * cp + sy * sr * sp
    return torch.stack((x, y, z, w), dim=-1)


def calc_heading(q: Tensor) -> Tensor:
    """Angle [rad] of the body's x axis in the ground plane."""
    forward = quat_axis(q, 0)
    return torch.atan2(forward[..., 1], forward[..., 0])


def calc_heading_quat(q: Tensor) -> Tensor:
    half = 0.5 * calc_heading(q)
    zero = torch.zeros_like(half)
    return torch.stack((zero, zero, torch.sin(half), torch.cos(half)), dim=-1)


def calc_heading_quat_inv(q: Tensor) -> Tensor:
    return quat_conjugate(calc_heading_quat(q))


def quat_to_angle_axis(q: Tensor) -> tuple[Tensor, Tensor]:
    """Angle in [-pi, pi] and unit axis; the z axis where there is no rotation."""
    w = q[..., 3].clamp(-1.0, 1.0)
    sine = torch.sqrt(1.0 - w * w)
    turned = sine > 1e-5
    angle = torch.where(turned, normalize_angle(2.0 * torch.acos(w)), torch.zeros_like(w))
    up = torch.eye(3, dtype=q.dtype, device=q.device)[2].expand((*q.shape[:-1], 3))
    axis = torch.where(turned.unsqueeze(-1), q[..., :3] / sine.clamp(min=1e-5).unsqueeze(-1), up)
    return angle, axis


def angle_axis_to_exp_map(angle: Tensor, axis: Tensor) -> Tensor:
    return angle.unsqueeze(-1) * axis


def euler_xyz_to_exp_map(roll: Tensor, pitch: Tensor, yaw: Tensor) -> Tensor:
    return quat_to_exp_map(quat_from_euler_xyz(roll, pitch, yaw))


def quat_to_exp_map(q: Tensor) -> Tensor:
    return angle_axis_to_exp_map(*quat_to_angle_axis(q))


def exp_map_to_angle_axis(exp_map: Tensor) -> tuple[Tensor, Tensor]:
    length = norm(exp_map)
    turned = length > 1e-5
    angle = torch.where(turned, normalize_angle(length), torch.zeros_like(length))
    up = torch.eye(3, dtype=exp_map.dtype, device=exp_map.device)[2].expand(exp_map.shape)
    return angle, torch.where(turned.unsqueeze(-1), exp_map / length.clamp(min=1e-5).unsqueeze(-1), up)


def exp_map_to_quat(exp_map: Tensor) -> Tensor:
    return quat_from_angle_axis(*exp_map_to_angle_axis(exp_map))


# --- rotation matrices: here, and only here, the real part of a quaternion comes first (w, x, y, z) ------------------


def quaternion_to_matrix(quaternions: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of quaternions (w, x, y, z), which need not have length 1."""
    w, vec = quaternions[..., :1], quaternions[..., 1:]
    columns = torch.eye(3, dtype=vec.dtype, device=vec.device).expand((*vec.shape, 3))
    vec, w = vec.unsqueeze(-2).expand(columns.shape), w.unsqueeze(-2)
    twice = 2.0 * torch.cross(vec, columns, dim=-1) / (quaternions * quaternions).sum(dim=-1)[..., None, None]
    return (columns + w * twice + torch.cross(vec, twice, dim=-1)).transpose(-1, -2)


def matrix_to_quaternion(matrix: Tensor) -> Tensor:
    """Quaternions (w, x, y, z) of rotation matrices (..., 3, 3), by the largest component (Shepperd, 1978)."""
    m = matrix.flatten(-2).unbind(-1)
    xx, yy, zz = m[0], m[4], m[8]
    squares = torch.stack((1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz), dim=-1)
    wx, wy, wz = m[7] - m[5], m[2] - m[6], m[3] - m[1]
    xy, xz, yz = m[1] + m[3], m[2] + m[6], m[5] + m[7]
    entries: tuple[Tensor, ...] = (squares[..., 0], wx, wy, wz, wx, squares[..., 1], xy, xz)
    entries += (wy, xy, squares[..., 2], yz, wz, xz, yz, squares[..., 3])
    rows = torch.stack(entries, dim=-1).unflatten(-1, (4, 4))  # pyright: ignore[reportUnknownVariableType]
    candidates = cast(Tensor, rows)  # row i: the quaternion times 4 q_i
    largest = squares.argmax(dim=-1)[..., None, None].expand((*squares.shape[:-1], 1, 4))
    return normalize(candidates.gather(-2, largest).squeeze(-2))


# --- rigid transforms ------------------------------------------------------------------------------------------------


def tf_inverse(q: Tensor, t: Tensor) -> tuple[Tensor, Tensor]:
    inverse = quat_conjugate(q)
    return inverse, -quat_apply(inverse, t)


def tf_apply(q: Tensor, t: Tensor, v: Tensor) -> Tensor:
    return quat_apply(q, v) + t


def tf_vector(q: Tensor, v: Tensor) -> Tensor:
    return quat_apply(q, v)


def tf_combine(q1: Tensor, t1: Tensor, q2: Tensor, t2: Tensor) -> tuple[Tensor, Tensor]:
    return quat_mul(q1, q2), quat_apply(q1, t2) + t1


def local_to_world_space(pos_offset_local: Tensor, pose_global: Tensor) -> Tensor:
    """World position of a point given in the frame of a pose (position 3, quaternion 4)."""
    return quat_apply(pose_global[..., 3:7], pos_offset_local) + pose_global[..., :3]


def normalise_quat_in_pose(pose: Tensor) -> Tensor:
    return torch.cat((pose[..., :3], normalize(pose[..., 3:7])), dim=-1)


# --- the observations of the locomotion tasks ------------------------------------------------------------------------


def compute_heading_and_up(
    torso_rotation: Tensor, inv_start_rot: Tensor, to_target: Tensor, vec0: Tensor, vec1: Tensor, up_idx: int
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Torso orientation relative to the start, up and heading projections (N,), up and heading vectors (N, 3)."""
    torso_quat = quat_mul(torso_rotation, inv_start_rot)
    up_vec, heading_vec = quat_rotate(torso_quat, vec1), quat_rotate(torso_quat, vec0)
    heading_proj = (heading_vec * normalize(to_target)).sum(dim=-1)
    return torso_quat, up_vec[..., up_idx], heading_proj, up_vec, heading_vec


def compute_rot(
    torso_quat: Tensor, velocity: Tensor, ang_velocity: Tensor, targets: Tensor, torso_positions: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Velocities in the torso frame, roll, pitch, yaw, and the angle to the target.

    The target's direction is taken in the x-z plane, as the environments that define this helper do.
    """
    to_target = targets - torso_positions
    roll, pitch, yaw = get_euler_xyz(torso_quat)
    angle_to_target = torch.atan2(to_target[..., 2], to_target[..., 0]) - yaw
    local = quat_rotate_inverse(torso_quat, velocity), quat_rotate_inverse(torso_quat, ang_velocity)
    return *local, roll, pitch, yaw, angle_to_target
