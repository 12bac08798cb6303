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
    kettle_handle_pos,
    bucket_handle_pos,
    kettle_spout_pos,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, kettle_handle_pos)
    left = reach(left_fingers, bucket_handle_pos)
    apart = torch.linalg.vector_norm(bucket_handle_pos - kettle_spout_pos, dim=-1)
    poured = torch.where(torch.maximum(right, left) < 0.7, 0.5 - 2.0 * apart, 0.0)
    reward = 1.0 - right - left + poured
    return reward, {"right": right, "left": left, "poured": poured}
