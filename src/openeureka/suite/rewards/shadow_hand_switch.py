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
    switch_right_handle_pos,
    switch_left_handle_pos,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, switch_right_handle_pos)
    left = reach(left_fingers, switch_left_handle_pos)
    sunk = 1.4 - switch_right_handle_pos[:, 2] - switch_left_handle_pos[:, 2]
    pressed = 50.0 * sunk
    reward = 2.0 - right - left + pressed
    return reward, {"right": right, "left": left, "pressed": pressed}
