import torch


def compute_reward(
    object_pos,
    object_linvel,
    goal_pos,
    fingertip_pos,
    fingertip_another_pos,
    pot_right_handle_pos,
    pot_left_handle_pos,
    actions,
):
    """Fingers at the handles, then height, then the goal; lifting pays only with both hands there."""
    right = torch.norm(fingertip_pos - pot_right_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left = torch.norm(fingertip_another_pos - pot_left_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    grip = torch.exp(-(right + left) / 0.15)
    height = torch.clamp((object_pos[:, 2] - 0.47) / 0.38, 0.0, 1.0)
    lift = torch.sqrt(grip + 0.01) * height
    home = torch.exp(-torch.norm(object_pos - goal_pos, dim=-1) / 0.1)
    sway = torch.norm(object_pos[:, :2] - goal_pos[:, :2], dim=-1)
    effort = torch.mean(actions**2, dim=-1)
    reward = grip + 5.0 * lift + 5.0 * home - 0.5 * sway - 0.02 * effort
    progress_grip = 1.0 - torch.maximum(right, left) / 0.2
    progress_lift = (object_pos[:, 2] - 0.46) / 0.38
    components = {"grip": grip, "lift": lift, "home": home, "sway": sway, "effort": effort}
    return reward, {**components, "progress_grip": progress_grip, "progress_lift": progress_lift}
