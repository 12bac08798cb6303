import torch
from isaacgym.torch_utils import quat_conjugate, quat_mul

CLOSED = -0.59  # [rad]


def reach(fingers, handle):
    return torch.linalg.vector_norm(torch.stack(fingers, dim=1) - handle[:, None], dim=-1).sum(dim=-1)


def compute_reward(
    right_hand_ff_pos,
    right_hand_mf_pos,
    right_hand_rf_pos,
    right_hand_lf_pos,
    right_hand_th_pos,
    left_hand_ff_pos,
    left_hand_mf_pos,
    left_hand_rf_pos,
    left_hand_lf_pos,
    left_hand_th_pos,
    scissors_right_handle_pos,
    scissors_left_handle_pos,
    scissors_right_handle_rot,
    scissors_left_handle_rot,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, scissors_right_handle_pos)
    left = reach(left_fingers, scissors_left_handle_pos)
    turn = quat_mul(quat_conjugate(scissors_left_handle_rot), scissors_right_handle_rot)
    angle = 2.0 * torch.atan(turn[:, 1] / turn[:, 3])
    opened = torch.where(torch.maximum(right, left) < 0.7, 5.0 * (angle - CLOSED), 0.0)
    reward = 2.0 - right - left + opened
    return reward, {"right": right, "left": left, "opened": opened}
