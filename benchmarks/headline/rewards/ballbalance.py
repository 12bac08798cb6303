import torch
from typing import Dict, Tuple


def compute_reward(ball_offset: torch.Tensor, ball_linvels: torch.Tensor, ball_height: torch.Tensor,
                   rest_position: torch.Tensor, actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    field_gain = 1.5      # 1/s
    field_temp = 0.3
    pos_temp = 0.15
    bounce_temp = 0.5
    height_scale = 0.1
    w_pos = 1.0
    w_field = 0.8
    w_bounce = 0.2
    w_height = 0.4
    w_action = 0.02

    offset = torch.norm(ball_offset, dim=-1)
    field_err = torch.norm(ball_linvels[:, :2] + field_gain * ball_offset, dim=-1)
    height_err = ball_height - rest_position[:, 2]
    on_level = 1.0 / (1.0 + (height_err / height_scale) ** 2)

    r_pos = w_pos * torch.exp(-offset / pos_temp)
    r_field = w_field * on_level * torch.exp(-field_err / field_temp)
    r_bounce = w_bounce * torch.exp(-torch.abs(ball_linvels[:, 2]) / bounce_temp)
    r_height = w_height * on_level
    r_action = -w_action * torch.mean(torch.abs(actions), dim=-1)

    reward = r_pos + r_field + r_bounce + r_height + r_action
    components = {
        "centre": r_pos,
        "velocity_field": r_field,
        "low_bounce": r_bounce,
        "height": r_height,
        "action_cost": r_action,
    }
    return reward, components
