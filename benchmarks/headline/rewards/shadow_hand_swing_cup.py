import torch
from typing import Dict, Tuple


def compute_reward(object_rot: torch.Tensor, goal_rot: torch.Tensor, rotation_distance: torch.Tensor,
                   object_angvel: torch.Tensor, object_linvel: torch.Tensor,
                   cup_right_handle_pos: torch.Tensor, cup_left_handle_pos: torch.Tensor,
                   fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    pi = 3.14159265
    reach_temp = 0.12        # m
    rate_scale = 3.0         # rad/s
    slow_angle = 0.5         # rad, below this the rate is not paid any more
    slow_width = 0.15
    w_reach = 0.5
    w_rate = 0.4
    w_turn, w_square = 2.5, 3.0
    w_done = 2.0
    done_angle, done_width = 0.4, 0.1   # rad
    w_fly = 0.05

    right_d = torch.norm(fingertip_pos - cup_right_handle_pos.unsqueeze(1), dim=-1)
    left_d = torch.norm(fingertip_another_pos - cup_left_handle_pos.unsqueeze(1), dim=-1)
    right_reach = w_reach * torch.exp(-right_d.mean(dim=-1) / reach_temp)
    left_reach = w_reach * torch.exp(-left_d.mean(dim=-1) / reach_temp)

    # goal = left * object, so `left` is the turn still to make, in the world frame
    left_turn = quat_mul(goal_rot, quat_conjugate(object_rot))
    sign = torch.where(left_turn[:, 3] < 0.0, -torch.ones_like(left_turn[:, 3]), torch.ones_like(left_turn[:, 3]))
    axis = left_turn[:, :3] * sign.unsqueeze(-1)
    axis = axis / (torch.norm(axis, dim=-1, keepdim=True) + 1e-6)
    rate = torch.sum(object_angvel * axis, dim=-1)
    gate = torch.sigmoid((rotation_distance - slow_angle) / slow_width)
    turning = w_rate * gate * torch.clamp(rate / rate_scale, min=-0.5, max=1.0)

    share = 1.0 - rotation_distance / pi
    turn = w_turn * share
    square = w_square * share ** 2
    done = w_done * torch.sigmoid((done_angle - rotation_distance) / done_width)
    fly = -torch.clamp(w_fly * torch.sum(object_linvel ** 2, dim=-1), max=0.3)

    reward = right_reach + left_reach + turning + turn + square + done + fly
    components = {
        "right_reach": right_reach,
        "left_reach": left_reach,
        "turning": turning,
        "turn": turn,
        "square": square,
        "done": done,
        "fly": fly,
    }
    return reward, components
