"""Rotation helpers against hand-computed rotations; quaternions are x, y, z, w."""

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
