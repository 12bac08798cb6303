import torch


def compute_reward(right_hand_pos, left_hand_pos, pot_right_handle_pos, pot_left_handle_pos, object_pos, goal_pos):
    right = torch.linalg.vector_norm(right_hand_pos - pot_right_handle_pos, dim=-1)
    left = torch.linalg.vector_norm(left_hand_pos - pot_left_handle_pos, dim=-1)
    lifted = 3.0 * (0.385 - torch.linalg.vector_norm(object_pos - goal_pos, dim=-1))
    lifted = torch.where(torch.maximum(right, left) < 0.08, lifted, 0.0)
    return 0.2 - right - left + lifted, {"right": right, "left": left, "lifted": lifted}
