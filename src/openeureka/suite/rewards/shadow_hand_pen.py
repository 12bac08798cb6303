import torch


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
    pen_right_handle_pos,
    pen_left_handle_pos,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, pen_right_handle_pos)
    left = reach(left_fingers, pen_left_handle_pos)
    apart = torch.linalg.vector_norm(pen_right_handle_pos - pen_left_handle_pos, dim=-1)
    pulled = torch.where(torch.maximum(right, left) < 0.75, 5.0 * apart - 0.8, 0.0)
    right_near, left_near = torch.exp(-10.0 * right), torch.exp(-10.0 * left)
    reward = right_near + left_near + pulled
    return reward, {"right_near": right_near, "left_near": left_near, "pulled": pulled}
