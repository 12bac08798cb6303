import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, object_linvel: torch.Tensor, goal_pos: torch.Tensor,
                   rotation_distance: torch.Tensor, actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    coarse_temp = 0.25
    fine_temp = 0.05
    speed_temp = 0.5
    rot_temp = 1.0

    coarse_weight = 1.0
    fine_weight = 3.0
    rest_weight = 2.0
    rot_weight = 0.5
    action_weight = 0.002

    distance = torch.norm(object_pos - goal_pos, dim=-1)
    speed = torch.norm(object_linvel, dim=-1)

    coarse = coarse_weight * torch.exp(-distance / coarse_temp)
    near = torch.exp(-distance / fine_temp)
    fine = fine_weight * near
    rest = rest_weight * near * torch.exp(-speed / speed_temp)
    rotation = rot_weight * near * torch.exp(-rotation_distance / rot_temp)
    action_cost = -action_weight * torch.sum(actions ** 2, dim=-1)

    reward = coarse + fine + rest + rotation + action_cost
    components = {
        "coarse_distance": coarse,
        "fine_distance": fine,
        "rest_at_goal": rest,
        "rotation": rotation,
        "action_cost": action_cost,
    }
    return reward, components
