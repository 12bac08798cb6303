import torch
from typing import Dict, Tuple


def compute_reward(scissors_right_handle_pos: torch.Tensor, scissors_left_handle_pos: torch.Tensor,
                   fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    closed = 0.068           # m between the handles at the start
    wide = 0.2               # m of opening taken as full
    coarse_temp = 0.2        # m, mean distance of the fingertips
    fine_temp = 0.05         # m, nearest fingertip
    w_coarse, w_fine = 0.5, 0.5
    w_open = 6.0
    w_action = 0.0008

    right_dist = torch.norm(fingertip_pos - scissors_right_handle_pos.unsqueeze(1), dim=-1)
    left_dist = torch.norm(fingertip_another_pos - scissors_left_handle_pos.unsqueeze(1), dim=-1)
    right_reach = w_coarse * torch.exp(-right_dist.mean(dim=-1) / coarse_temp) + w_fine * torch.exp(-right_dist.amin(dim=-1) / fine_temp)
    left_reach = w_coarse * torch.exp(-left_dist.mean(dim=-1) / coarse_temp) + w_fine * torch.exp(-left_dist.amin(dim=-1) / fine_temp)

    gap = torch.norm(scissors_right_handle_pos - scissors_left_handle_pos, dim=-1)
    opening = w_open * torch.clamp((gap - closed) / wide, min=-0.3, max=1.5)

    action_cost = -w_action * torch.sum(actions ** 2, dim=-1)

    reward = right_reach + left_reach + opening + action_cost
    components = {
        "right_reach": right_reach,
        "left_reach": left_reach,
        "opening": opening,
        "action_cost": action_cost,
    }
    return reward, components
