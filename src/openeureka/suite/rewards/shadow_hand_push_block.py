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
    block_right_handle_pos,
    block_left_handle_pos,
    right_goal_pos,
    left_goal_pos,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, block_right_handle_pos)
    left = reach(left_fingers, block_left_handle_pos)
    right_away = torch.linalg.vector_norm(block_right_handle_pos - right_goal_pos, dim=-1)
    left_away = torch.linalg.vector_norm(block_left_handle_pos - left_goal_pos, dim=-1)
    reward = (1.2 - right) + (1.2 - left) + 5.0 - 5.0 * (right_away + left_away)
    return reward, {"right": right, "left": left, "right_away": right_away, "left_away": left_away}
