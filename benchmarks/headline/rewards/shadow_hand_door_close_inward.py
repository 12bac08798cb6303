import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   door_right_handle_pos: torch.Tensor, door_left_handle_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    tip_temperature = 0.12
    open_distance = 0.615
    closed_distance = 0.06
    w_reach = 1.0
    w_close = 3.0
    w_done = 2.0
    w_action = 0.02

    right_tips = torch.norm(fingertip_pos - door_right_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left_tips = torch.norm(fingertip_another_pos - door_left_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    reach = w_reach * (torch.exp(-right_tips / tip_temperature) + torch.exp(-left_tips / tip_temperature))

    span = open_distance - closed_distance
    right_rest = torch.norm((door_right_handle_pos - object_pos)[:, :2], dim=-1)
    left_rest = torch.norm((door_left_handle_pos - object_pos)[:, :2], dim=-1)
    right_share = torch.clamp((open_distance - right_rest) / span, -0.2, 1.0)
    left_share = torch.clamp((open_distance - left_rest) / span, -0.2, 1.0)
    closing = w_close * (right_share + left_share)
    done = w_done * torch.sigmoid((torch.minimum(right_share, left_share) - 0.9) / 0.04)
    action = -w_action * torch.mean(torch.square(actions), dim=-1)

    reward = reach + closing + done + action
    components = {
        "reach": reach, "closing": closing, "done": done, "action": action,
        "right_share": right_share, "left_share": left_share,
    }
    return reward, components
