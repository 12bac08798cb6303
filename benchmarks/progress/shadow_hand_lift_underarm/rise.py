import torch


def compute_reward(
    object_pos,
    object_rot,
    object_linvel,
    goal_pos,
    right_hand_pos,
    left_hand_pos,
    pot_right_handle_pos,
    pot_left_handle_pos,
):
    """Palms at the handles, the rate of rising and the height reached, with the pot level."""
    palms = torch.norm(right_hand_pos - pot_right_handle_pos, dim=-1)
    palms = palms + torch.norm(left_hand_pos - pot_left_handle_pos, dim=-1)
    reach = torch.exp(-palms / 0.2)
    level = 1.0 - 2.0 * (object_rot[:, 0] ** 2 + object_rot[:, 1] ** 2)
    rising = torch.clamp(object_linvel[:, 2], -0.3, 0.5) * torch.relu(level)
    height = torch.clamp((object_pos[:, 2] - 0.47) / 0.38, 0.0, 1.2)
    left_over = torch.norm(goal_pos - object_pos, dim=-1)
    reward = reach + 3.0 * rising + 4.0 * height * torch.relu(level) + 2.0 * torch.exp(-left_over / 0.05)
    progress_reach = 1.0 - palms / 0.3
    progress_lift = (object_pos[:, 2] - 0.46) / 0.38
    progress_level = (level - 0.5) / 0.5
    components = {"reach": reach, "rising": rising, "height": height}
    told = {"progress_reach": progress_reach, "progress_lift": progress_lift, "progress_level": progress_level}
    return reward, {**components, **told}
