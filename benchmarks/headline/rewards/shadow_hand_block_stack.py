import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, block_pos: torch.Tensor, goal_pos: torch.Tensor,
                   fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    tip_temperature = 0.06
    place_temperature = 0.05
    stack_wide = 0.1
    stack_fine = 0.025
    block_size = 0.05
    w_reach = 0.8
    w_place = 1.0
    w_lift = 1.0
    w_stack = 2.0
    w_fine = 3.0
    w_action = 0.02

    shift = torch.zeros_like(goal_pos)
    shift[:, 1] = -0.1
    place = goal_pos + shift

    right_tips = torch.norm(fingertip_pos - object_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left_tips = torch.norm(fingertip_another_pos - block_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    reach = w_reach * (torch.exp(-right_tips / tip_temperature) + torch.exp(-left_tips / tip_temperature))

    place_error = torch.norm(object_pos - place, dim=-1)
    placed = torch.exp(-place_error / place_temperature)
    place_pay = w_place * placed

    lift_height = torch.clamp(block_pos[:, 2] - goal_pos[:, 2], 0.0, block_size)
    lift = w_lift * lift_height / block_size

    up = torch.zeros_like(goal_pos)
    up[:, 2] = block_size
    stack_error = torch.norm(block_pos - (object_pos + up), dim=-1)
    stack = w_stack * torch.exp(-stack_error / stack_wide)
    fine = w_fine * torch.exp(-stack_error / stack_fine) * (0.3 + 0.7 * placed)
    action = -w_action * torch.mean(torch.square(actions), dim=-1)

    reward = reach + place_pay + lift + stack + fine + action
    components = {
        "reach": reach, "place": place_pay, "lift": lift, "stack": stack, "fine": fine, "action": action,
        "place_error": place_error, "stack_error": stack_error,
    }
    return reward, components
