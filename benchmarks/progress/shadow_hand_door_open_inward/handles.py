import torch


def compute_reward(fingertip_pos, fingertip_another_pos, door_right_handle_pos, door_left_handle_pos, actions):
    """Fingers at both handles, and the handles apart."""
    right = torch.norm(fingertip_pos - door_right_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left = torch.norm(fingertip_another_pos - door_left_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    reach = torch.exp(-right / 0.1) + torch.exp(-left / 0.1)
    gap = torch.norm(door_right_handle_pos - door_left_handle_pos, dim=-1) - 0.067
    open_a_bit = torch.clamp(gap / 0.1, 0.0, 1.0)
    open_wide = torch.clamp(gap / 0.6, 0.0, 1.5)
    effort = torch.mean(actions**2, dim=-1)
    reward = 0.5 * reach + 2.0 * open_a_bit + 5.0 * open_wide - 0.02 * effort
    progress_reach = 1.0 - torch.maximum(right, left) / 0.25
    progress_ajar = gap / 0.1
    progress_open = gap / 0.6
    components = {"reach": reach, "open_a_bit": open_a_bit, "open_wide": open_wide, "effort": effort}
    told = {"progress_reach": progress_reach, "progress_ajar": progress_ajar, "progress_open": progress_open}
    return reward, {**components, **told}
