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
    cup_right_handle_pos,
    cup_left_handle_pos,
    rotation_distance,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, cup_right_handle_pos)
    left = reach(left_fingers, cup_left_handle_pos)
    turned = 1.0 / (rotation_distance + 0.1) - 1.0
    turned = torch.where(torch.maximum(right, left) < 0.4, turned, 0.0)
    return -right - left + turned, {"right": right, "left": left, "turned": turned}
