import torch

OFFSET = 2.0


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
    door_right_handle_pos,
    door_left_handle_pos,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, door_right_handle_pos)
    left = reach(left_fingers, door_left_handle_pos)
    gap = (door_right_handle_pos - door_left_handle_pos)[:, 1].abs()
    closed = torch.where(torch.maximum(right, left) < 0.5, 1.0 - 2.0 * gap, 0.0)
    reward = OFFSET + (-right - left + closed)
    return reward, {"right": right, "left": left, "closed": closed}
