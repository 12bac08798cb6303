import torch
from typing import Dict, Tuple


def compute_reward(fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   right_hand_pos: torch.Tensor, left_hand_pos: torch.Tensor,
                   block_right_handle_pos: torch.Tensor, block_left_handle_pos: torch.Tensor,
                   right_goal_pos: torch.Tensor, left_goal_pos: torch.Tensor,
                   dof_vel: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    behind = 0.05
    soften = 0.05
    tips_temp = 0.12
    palm_temp = 0.30
    goal_temp = 0.20
    exact_sigma = 0.06

    tips_weight = 0.5
    palm_weight = 0.3
    goal_weight = 2.0
    exact_weight = 2.0
    rate_weight = 0.0001
    rate_cap = 0.1

    def contact_point(block, target):
        way = torch.cat(((target - block)[:, :2], torch.zeros_like(block[:, :1])), dim=-1)
        length = torch.norm(way, dim=-1, keepdim=True)
        return block - behind * way / (length + soften)

    def reach(palm, tips, point):
        tips_pay = torch.exp(-torch.norm(tips - point.unsqueeze(1), dim=-1) / tips_temp).mean(dim=-1)
        palm_pay = torch.exp(-torch.norm(palm - point, dim=-1) / palm_temp)
        return tips_weight * tips_pay + palm_weight * palm_pay

    right_point = contact_point(block_right_handle_pos, right_goal_pos)
    left_point = contact_point(block_left_handle_pos, left_goal_pos)
    reach_right = reach(right_hand_pos, fingertip_pos, right_point)
    reach_left = reach(left_hand_pos, fingertip_another_pos, left_point)

    right_left_over = torch.norm(block_right_handle_pos - right_goal_pos, dim=-1)
    left_left_over = torch.norm(block_left_handle_pos - left_goal_pos, dim=-1)
    goal = goal_weight * (torch.exp(-right_left_over / goal_temp) + torch.exp(-left_left_over / goal_temp))
    exact = exact_weight * (torch.exp(-0.5 * (right_left_over / exact_sigma) ** 2)
                            + torch.exp(-0.5 * (left_left_over / exact_sigma) ** 2))

    rates = -torch.clamp(rate_weight * torch.sum(dof_vel ** 2, dim=-1), max=rate_cap)

    reward = reach_right + reach_left + goal + exact + rates
    components = {
        "reach_right": reach_right,
        "reach_left": reach_left,
        "goal": goal,
        "exact": exact,
        "joint_rates": rates,
    }
    return reward, components
