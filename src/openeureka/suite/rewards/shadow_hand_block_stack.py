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
    goal_pos,
):
    right_fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    left_fingers = [left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos]
    right = reach(right_fingers, block_right_handle_pos)
    left = reach(left_fingers, block_left_handle_pos)
    lower = torch.linalg.vector_norm(block_right_handle_pos - (goal_pos + torch.tensor([0.0, -0.1, 0.0])), dim=-1)
    upper = torch.linalg.vector_norm(block_left_handle_pos - (goal_pos + torch.tensor([0.0, -0.1, 0.05])), dim=-1)
    height_error = (0.675 - block_left_handle_pos[:, 2]).abs()
    gathered = torch.where(torch.maximum(right, left) < 0.5, 2.0 * (0.24 - lower - upper), 0.0)
    stacked = torch.where(torch.maximum(lower, upper) < 0.07, 50.0 * (0.05 - height_error), 0.0)
    reward = 1.5 - right - left + gathered + stacked
    return reward, {"right": right, "left": left, "gathered": gathered, "stacked": stacked}
