"""Rotation helpers against hand-computed rotations. Quaternions are (x, y, z, w)."""

from __future__ import annotations

import math

import pytest
import torch

from openeureka.reward import math as helpers
from openeureka.reward import surface

HALF = math.sqrt(0.5)
QUARTER_TURN_Z = torch.tensor([[0.0, 0.0, HALF, HALF]])  # 90 degrees about z
X, Y, Z = torch.eye(3).unsqueeze(1)


def close(actual: torch.Tensor, expected: object) -> None:
    torch.testing.assert_close(actual, torch.as_tensor(expected), rtol=1e-5, atol=1e-6)


def random_rotations(count: int = 64) -> torch.Tensor:
    drawn = torch.randn(count, 4, generator=torch.Generator().manual_seed(0))
    return torch.nn.functional.normalize(drawn, dim=-1)


def test_every_helper_that_is_offered_exists() -> None:
    assert all(callable(getattr(helpers, name)) for name in surface.ALL_HELPERS)


def test_a_quarter_turn_about_z_sends_x_to_y() -> None:
    for rotate in (helpers.quat_apply, helpers.quat_rotate, helpers.my_quat_rotate, helpers.get_basis_vector):
        close(rotate(QUARTER_TURN_Z, X), Y)
    close(helpers.quat_rotate_inverse(QUARTER_TURN_Z, Y), X)


def test_two_quarter_turns_are_a_half_turn() -> None:
    close(helpers.quat_mul(QUARTER_TURN_Z, QUARTER_TURN_Z), [[0.0, 0.0, 1.0, 0.0]])


def test_a_product_rotates_by_its_right_factor_first() -> None:
    a, b = random_rotations(), random_rotations().flip(0)
    vector = torch.randn(64, 3, generator=torch.Generator().manual_seed(1))
    product = helpers.quat_apply(helpers.quat_mul(a, b), vector)
    close(product, helpers.quat_apply(a, helpers.quat_apply(b, vector)))


def test_the_angle_between_orientations() -> None:
    identity = torch.tensor([[0.0, 0.0, 0.0, 1.0]])
    close(helpers.quat_diff_rad(QUARTER_TURN_Z, identity), [math.pi / 2])
    close(helpers.quat_diff_rad(-QUARTER_TURN_Z, identity), [math.pi / 2])  # q and -q are one rotation


def test_euler_angles_of_known_turns_lie_between_0_and_2_pi() -> None:
    roll, pitch, yaw = helpers.get_euler_xyz(QUARTER_TURN_Z)
    close(torch.cat((roll, pitch, yaw)), [0.0, 0.0, math.pi / 2])
    backwards = helpers.quat_conjugate(QUARTER_TURN_Z)
    close(helpers.get_euler_xyz(backwards)[2], [1.5 * math.pi])  # -90 degrees, wrapped


def test_euler_angles_and_back() -> None:
    rotations = random_rotations()
    again = helpers.quat_from_euler_xyz(*helpers.get_euler_xyz(rotations))
    close((again * rotations).sum(-1).abs(), torch.ones(64))


def test_angle_and_axis_and_back() -> None:
    rotations = random_rotations()
    again = helpers.quat_from_angle_axis(*helpers.quat_to_angle_axis(rotations))
    close((again * rotations).sum(-1).abs(), torch.ones(64))
    mapped = helpers.exp_map_to_quat(helpers.quat_to_exp_map(rotations))
    close((mapped * rotations).sum(-1).abs(), torch.ones(64))


def test_no_rotation_has_angle_zero_about_z() -> None:
    angle, axis = helpers.quat_to_angle_axis(torch.tensor([[0.0, 0.0, 0.0, 1.0]]))
    close(angle, [0.0])
    close(axis, Z)


def test_heading_and_up_of_an_upright_body_that_faces_the_target() -> None:
    identity = torch.tensor([[0.0, 0.0, 0.0, 1.0]])
    _, up, heading, up_vec, heading_vec = helpers.compute_heading_and_up(identity, identity, 1000.0 * X, X, Z, 2)
    close(torch.cat((up, heading)), [1.0, 1.0])
    close(up_vec, Z)
    close(heading_vec, X)


def test_a_body_that_is_turned_left_moves_to_its_right_when_it_moves_along_x() -> None:
    velocity = helpers.compute_rot(QUARTER_TURN_Z, X, Z, 1000.0 * X, torch.zeros(1, 3))[0]
    close(velocity, -Y)


def test_scaling_between_limits() -> None:
    lower, upper = torch.tensor([-1.0]), torch.tensor([3.0])
    close(helpers.unscale(torch.tensor([[1.0], [3.0]]), lower, upper), [[0.0], [1.0]])  # middle and upper limit
    close(helpers.scale(torch.tensor([[0.0], [1.0]]), lower, upper), [[1.0], [3.0]])


@pytest.mark.parametrize("wrap", [helpers.normalize_angle, helpers.wrap_to_pi])
def test_angles_wrap_to_half_a_turn(wrap) -> None:
    close(wrap(torch.tensor([0.5, 2 * math.pi + 0.5, -2 * math.pi - 0.5])), [0.5, 0.5, -0.5])


def test_a_halfway_rotation() -> None:
    identity = torch.tensor([[0.0, 0.0, 0.0, 1.0]])
    halfway = helpers.slerp(identity, QUARTER_TURN_Z, torch.tensor([[0.5]]))
    close(halfway, [[0.0, 0.0, math.sin(math.pi / 8), math.cos(math.pi / 8)]])  # 45 degrees


def test_transforms_compose_and_invert() -> None:
    q, t = random_rotations(), torch.randn(64, 3, generator=torch.Generator().manual_seed(2))
    inverse = helpers.tf_inverse(q, t)
    back = helpers.tf_apply(*inverse, helpers.tf_apply(q, t, t))
    close(back, t)
    joined_q, joined_t = helpers.tf_combine(*inverse, q, t)
    close(joined_q.abs()[:, 3], torch.ones(64))
    close(joined_t, torch.zeros(64, 3))


# --- against the matrix exponential, which shares no formula with the helpers ----------------------------------------


def turns(count: int = 64) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """Angles in (0, pi), unit axes, quaternions (x, y, z, w) by their definition, and rotation matrices."""
    generator = torch.Generator().manual_seed(3)
    angle = math.pi * (0.01 + 0.98 * torch.rand(count, generator=generator))
    axis = torch.nn.functional.normalize(torch.randn(count, 3, generator=generator), dim=-1)
    x, y, z = (angle.unsqueeze(-1) * axis).unbind(-1)
    zero = torch.zeros_like(x)
    skew = torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), dim=-1).view(-1, 3, 3)
    quaternion = torch.cat((axis * torch.sin(angle / 2).unsqueeze(-1), torch.cos(angle / 2).unsqueeze(-1)), dim=-1)
    return angle, axis, quaternion, torch.linalg.matrix_exp(skew)


def rotated(matrix: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
    return (matrix @ vector.unsqueeze(-1)).squeeze(-1)


def vectors(count: int = 64) -> torch.Tensor:
    return torch.randn(count, 3, generator=torch.Generator().manual_seed(4))


@pytest.mark.parametrize("name", ["quat_apply", "quat_rotate", "my_quat_rotate", "get_basis_vector", "tf_vector"])
def test_rotations_are_those_of_the_matrix(name: str) -> None:
    _, _, quaternion, matrix = turns()
    close(getattr(helpers, name)(quaternion, vectors()), rotated(matrix, vectors()))


def test_the_inverse_rotation_is_that_of_the_transposed_matrix() -> None:
    _, _, quaternion, matrix = turns()
    close(helpers.quat_rotate_inverse(quaternion, vectors()), rotated(matrix.mT, vectors()))
    inverse, offset = helpers.tf_inverse(quaternion, vectors())
    close(helpers.quat_apply(inverse, X.expand(64, 3)), matrix.mT[..., 0])
    close(offset, -rotated(matrix.mT, vectors()))


def test_products_are_those_of_the_matrices() -> None:
    _, _, quaternion, matrix = turns()
    product = helpers.quat_mul(quaternion, quaternion.flip(0))
    close(helpers.quat_apply(product, vectors()), rotated(matrix @ matrix.flip(0), vectors()))


def test_angles_and_axes_are_those_of_the_turn() -> None:
    angle, axis, quaternion, _ = turns()
    close(helpers.quat_from_angle_axis(angle, 5.0 * axis), quaternion)
    found_angle, found_axis = helpers.quat_to_angle_axis(quaternion)
    torch.testing.assert_close(found_angle, angle, rtol=1e-3, atol=1e-3)  # acos near 1 loses digits
    torch.testing.assert_close(found_axis, axis, rtol=1e-3, atol=1e-3)
    torch.testing.assert_close(helpers.quat_to_exp_map(quaternion), angle.unsqueeze(-1) * axis, rtol=1e-3, atol=1e-3)
    close(helpers.exp_map_to_quat(angle.unsqueeze(-1) * axis), quaternion)
    identity = torch.tensor([0.0, 0.0, 0.0, 1.0]).expand(64, 4)
    torch.testing.assert_close(helpers.quat_diff_rad(quaternion, identity), angle, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_body_axes_are_the_columns_of_the_matrix(axis: int) -> None:
    _, _, quaternion, matrix = turns()
    close(helpers.quat_axis(quaternion, axis), matrix[..., axis])


def test_tangent_and_normal_are_two_columns() -> None:
    _, _, quaternion, matrix = turns()
    close(helpers.quat_to_tan_norm(quaternion), torch.cat((matrix[..., 0], matrix[..., 2]), dim=-1))


def test_euler_angles_turn_about_x_then_y_then_z() -> None:
    """The entries of Rz(yaw) Ry(pitch) Rx(roll)."""
    _, _, quaternion, matrix = turns()
    roll, pitch, yaw = helpers.get_euler_xyz(quaternion)
    close(torch.stack((torch.cos(pitch) * torch.cos(yaw), torch.cos(pitch) * torch.sin(yaw)), -1), matrix[:, :2, 0])
    close(-torch.sin(pitch), matrix[:, 2, 0])
    close(torch.stack((torch.cos(pitch) * torch.sin(roll), torch.cos(pitch) * torch.cos(roll)), -1), matrix[:, 2, 1:])
    assert all(bool(((angle >= 0) & (angle < 2 * math.pi)).all()) for angle in (roll, pitch, yaw))
    exp_map = helpers.euler_xyz_to_exp_map(roll, pitch, yaw)
    torch.testing.assert_close(exp_map, helpers.quat_to_exp_map(quaternion), rtol=1e-3, atol=1e-3)


def test_headings_are_those_of_the_first_column() -> None:
    _, _, quaternion, matrix = turns()
    heading = torch.atan2(matrix[:, 1, 0], matrix[:, 0, 0])
    close(helpers.calc_heading(quaternion), heading)
    flat = helpers.quat_apply(helpers.calc_heading_quat(quaternion), X.expand(64, 3))
    close(flat, torch.stack((torch.cos(heading), torch.sin(heading), torch.zeros(64)), dim=-1))
    back = helpers.quat_mul(helpers.calc_heading_quat_inv(quaternion), helpers.calc_heading_quat(quaternion))
    close(back, torch.tensor([0.0, 0.0, 0.0, 1.0]).expand(64, 4))


def test_only_the_yaw_part_rotates() -> None:
    tilted = helpers.quat_mul(QUARTER_TURN_Z, torch.tensor([[HALF, 0.0, 0.0, HALF]]))  # roll by 90 degrees, then yaw
    close(helpers.quat_apply_yaw(tilted, Z), Z)


def test_matrices_take_and_give_the_real_part_first() -> None:
    _, _, quaternion, matrix = turns()
    real_first = quaternion.roll(1, dims=-1)
    close(helpers.quaternion_to_matrix(real_first), matrix)
    close(helpers.quaternion_to_matrix(3.0 * real_first), matrix)
    close((helpers.matrix_to_quaternion(matrix) * real_first).sum(-1).abs(), torch.ones(64))
    half_turns = torch.diag_embed(torch.tensor([[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]))
    close(helpers.matrix_to_quaternion(half_turns).abs(), torch.eye(4)[1:])  # w is 0, so the largest entry is another


def test_points_of_a_frame_in_the_world() -> None:
    _, _, quaternion, matrix = turns()
    pose = torch.cat((vectors().flip(0), 2.0 * quaternion), dim=-1)
    unit = helpers.normalise_quat_in_pose(pose)
    close(unit[:, 3:], quaternion)
    close(helpers.local_to_world_space(vectors(), unit), rotated(matrix, vectors()) + vectors().flip(0))
    close(helpers.tf_apply(quaternion, vectors().flip(0), vectors()), rotated(matrix, vectors()) + vectors().flip(0))


def test_a_quaternion_of_another_length_scales_as_in_the_environments() -> None:
    # (2 w^2 - 1) v + 2 w (q x v) + 2 q (q . v) of q = (0, 0, 1, 2) and v = x: 7 x + 4 y
    close(helpers.quat_rotate(torch.tensor([[0.0, 0.0, 1.0, 2.0]]), X), [[7.0, 4.0, 0.0]])


def test_one_vector_for_all_rotations() -> None:
    _, _, quaternion, matrix = turns()
    close(helpers.quat_rotate(quaternion, torch.tensor([0.0, 0.0, 1.0])), matrix[..., 2])
    close(helpers.quat_apply(quaternion, Z), matrix[..., 2])


def test_clamps_and_scales() -> None:
    lower, upper, x = torch.tensor([-1.0, 0.0]), torch.tensor([3.0, 2.0]), torch.tensor([[5.0, -1.0], [1.0, 1.0]])
    for clamp in (helpers.tensor_clamp, helpers.saturate):
        close(clamp(x, lower, upper), [[3.0, 0.0], [1.0, 1.0]])
    for to_unit in (helpers.unscale, helpers.unscale_np, helpers.scale_transform):
        close(to_unit(x, lower, upper), [[2.0, -2.0], [0.0, 0.0]])  # (2x - upper - lower) / (upper - lower)
    close(helpers.unscale_transform(helpers.scale_transform(x, lower, upper), lower, upper), x)


def test_small_helpers() -> None:
    close(helpers.copysign(-2.0, torch.tensor([-0.5, 0.0, 3.0])), [-2.0, 0.0, 2.0])
    assert helpers.get_axis_params(-1.0, 2) == [0.0, 0.0, -1.0]
    assert helpers.get_axis_params(1.0, 1, 0.5, float, 4) == [0.5, 1.0, 0.0, 0.0]
    close(helpers.normalize(torch.tensor([[3.0, 4.0], [0.0, 0.0]])), [[0.6, 0.8], [0.0, 0.0]])
    close(helpers.quat_unit(torch.tensor([[0.0, 3.0, 0.0, 4.0]])), [[0.0, 0.6, 0.0, 0.8]])
    close(helpers.to_torch([1, 2], device="cuda:0"), torch.tensor([1.0, 2.0]))
