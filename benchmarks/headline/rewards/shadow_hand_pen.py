import torch
from typing import Dict, Tuple


def compute_reward(pen_right_handle_pos: torch.Tensor, pen_left_handle_pos: torch.Tensor,
                   fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    capped = 0.17            # m between the grasp points at the start
    pull_unit = 0.05         # m
    coarse_temp = 0.15       # m
    fine_temp = 0.04         # m
    w_coarse, w_fine = 0.6, 0.4
    w_pull = 3.0
    w_action = 0.0008

    def reach(tips, handle):
        d = torch.norm(tips - handle.unsqueeze(1), dim=-1)
        return w_coarse * torch.exp(-d.mean(dim=-1) / coarse_temp) + w_fine * torch.exp(-d.amin(dim=-1) / fine_temp)

    right_reach = reach(fingertip_pos, pen_right_handle_pos)
    left_reach = reach(fingertip_another_pos, pen_left_handle_pos)

    gap = torch.norm(pen_right_handle_pos - pen_left_handle_pos, dim=-1)
    pull = w_pull * torch.clamp((gap - capped) / pull_unit, min=-0.3, max=4.0)
    action_cost = -w_action * torch.sum(actions ** 2, dim=-1)

    reward = right_reach + left_reach + pull + action_cost
    components = {
        "right_reach": right_reach,
        "left_reach": left_reach,
        "pull": pull,
        "action_cost": action_cost,
    }
    return reward, components
