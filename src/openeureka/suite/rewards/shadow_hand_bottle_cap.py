import torch


def compute_reward(
    right_hand_ff_pos,
    right_hand_mf_pos,
    right_hand_rf_pos,
    right_hand_lf_pos,
    right_hand_th_pos,
    left_hand_pos,
    bottle_pos,
    bottle_cap_pos,
    bottle_cap_up,
):
    fingers = [right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos]
    right = torch.linalg.vector_norm(torch.stack(fingers, dim=1) - bottle_cap_pos[:, None], dim=-1).sum(dim=-1)
    left = torch.linalg.vector_norm(bottle_pos - left_hand_pos, dim=-1)
    lifted = 30.0 * torch.linalg.vector_norm(bottle_cap_up - bottle_pos, dim=-1)
    lifted = torch.where(right <= 0.3, lifted, 0.0)
    return 2.0 - right - left + lifted, {"right": right, "left": left, "lifted": lifted}
