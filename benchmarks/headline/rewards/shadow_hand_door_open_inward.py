import torch
from typing import Dict, Tuple


def hold(tips: torch.Tensor, handle: torch.Tensor) -> torch.Tensor:
    distance = torch.norm(tips - handle.unsqueeze(1), dim=-1)
    thumb = torch.exp(-distance[:, 4] / 0.08)
    nearest = torch.topk(-distance[:, :4], 2, dim=-1).values
    fingers = torch.exp(nearest / 0.05).mean(dim=-1)
    return 0.4 * thumb + 0.6 * fingers


def compute_reward(object_pos: torch.Tensor, fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   door_right_handle_pos: torch.Tensor, door_left_handle_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    closed_x = 0.047
    x_scale = 0.3
    mean_temperature = 0.15
    w_alive = 0.3
    w_mean = 0.6
    w_hold = 0.8
    w_pull = 0.15
    w_open = 3.5
    w_wide = 2.0

    right_mean = torch.norm(fingertip_pos - door_right_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left_mean = torch.norm(fingertip_another_pos - door_left_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    mean_reach = w_mean * (torch.exp(-right_mean / mean_temperature) + torch.exp(-left_mean / mean_temperature))

    right_hold = hold(fingertip_pos, door_right_handle_pos)
    left_hold = hold(fingertip_another_pos, door_left_handle_pos)
    held = w_hold * (right_hold + left_hold)

    # column 0: force of the right hand's base in x, column 26: of the left hand's
    right_force = torch.clamp(actions[:, 0], -1.0, 1.0)
    left_force = torch.clamp(actions[:, 26], -1.0, 1.0)
    pull = w_pull * (right_hold * right_force + left_hold * left_force)

    right_x = torch.clamp((door_right_handle_pos[:, 0] - object_pos[:, 0] - closed_x) / x_scale, 0.0, 1.2)
    left_x = torch.clamp((door_left_handle_pos[:, 0] - object_pos[:, 0] - closed_x) / x_scale, 0.0, 1.2)
    opened = 0.5 * w_open * (right_x + left_x)
    wide = w_wide * torch.clamp((door_right_handle_pos[:, 1] - door_left_handle_pos[:, 1] - 0.067) / 0.7, 0.0, 1.2)
    alive = w_alive * torch.ones_like(right_mean)

    reward = alive + mean_reach + held + pull + opened + wide
    components = {
        "alive": alive, "mean_reach": mean_reach, "held": held, "pull": pull, "opened": opened, "wide": wide,
    }
    return reward, components
