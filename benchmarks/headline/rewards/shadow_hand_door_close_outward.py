import torch
from typing import Dict, Tuple


def closeness(distance: torch.Tensor, scale: float) -> torch.Tensor:
    return 1.0 / (1.0 + distance / scale)


def compute_reward(object_pos: torch.Tensor, fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   right_hand_pos: torch.Tensor, left_hand_pos: torch.Tensor,
                   door_right_handle_pos: torch.Tensor, door_left_handle_pos: torch.Tensor,
                   dof_vel: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    tip_scale = 0.1
    palm_scale = 0.2
    open_y = 0.385
    open_x = 0.4
    w_tips = 1.0
    w_palm = 0.5
    w_start = 0.8
    w_y = 2.0
    w_x = 2.0
    w_shut = 3.0
    w_rate = 0.005

    right_tips = torch.norm(fingertip_pos - door_right_handle_pos.unsqueeze(1), dim=-1)
    left_tips = torch.norm(fingertip_another_pos - door_left_handle_pos.unsqueeze(1), dim=-1)
    tips = w_tips * (closeness(right_tips, tip_scale).mean(dim=-1) + closeness(left_tips, tip_scale).mean(dim=-1))
    palm = w_palm * (closeness(torch.norm(right_hand_pos - door_right_handle_pos, dim=-1), palm_scale)
                     + closeness(torch.norm(left_hand_pos - door_left_handle_pos, dim=-1), palm_scale))

    right = door_right_handle_pos - object_pos
    left = door_left_handle_pos - object_pos
    right_y = torch.clamp((open_y - right[:, 1]) / open_y, 0.0, 1.0)
    left_y = torch.clamp((open_y + left[:, 1]) / open_y, 0.0, 1.0)
    right_x = torch.clamp((right[:, 0] + open_x) / open_x, 0.0, 1.0)
    left_x = torch.clamp((left[:, 0] + open_x) / open_x, 0.0, 1.0)
    in_y = w_y * (right_y + left_y)
    in_x = w_x * (right_x + left_x)
    # the first centimetres, which go mostly in y
    start = w_start * (torch.tanh(right_y / 0.1) + torch.tanh(left_y / 0.1))
    shut = w_shut * right_y * left_y * right_x * left_x
    rate = -w_rate * torch.clamp(torch.mean(torch.abs(dof_vel), dim=-1), max=10.0)

    reward = tips + palm + in_y + in_x + start + shut + rate
    components = {
        "tips": tips, "palm": palm, "in_y": in_y, "in_x": in_x, "start": start, "shut": shut, "rate": rate,
    }
    return reward, components
