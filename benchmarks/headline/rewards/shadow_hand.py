import torch
from typing import Dict, Tuple


def compute_reward(
    object_pos: torch.Tensor,
    object_rot: torch.Tensor,
    object_linvel: torch.Tensor,
    object_angvel: torch.Tensor,
    goal_pos: torch.Tensor,
    goal_rot: torch.Tensor,
    rotation_distance: torch.Tensor,
    shadow_hand_dof_vel: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    max_rate, close_angle = 4.0, 0.5
    w_keep, w_rate, w_close, w_goal, w_away, w_down, w_vel = 0.2, 0.4, 0.5, 20.0, 1.0, 0.1, 0.0002

    offset = object_pos - goal_pos
    dist = torch.norm(offset, dim=-1)
    keep = w_keep * torch.exp(-torch.clamp(dist - 0.04, min=0.0) / 0.05)
    away = -w_away * torch.clamp((dist - 0.08) / 0.16, 0.0, 1.0)
    gate = torch.clamp(1.0 - (dist - 0.08) / 0.06, 0.0, 1.0)

    left = quat_mul(goal_rot, quat_conjugate(object_rot))
    flip = torch.where(left[:, 3:4] < 0, -torch.ones_like(left[:, 3:4]), torch.ones_like(left[:, 3:4]))
    vec = left[:, :3] * flip
    axis = vec / torch.clamp(torch.norm(vec, dim=-1, keepdim=True), min=1e-4)
    shrink = torch.sum(object_angvel * axis, dim=-1)
    # shrinking counts a little more close to the goal
    weight = 1.0 + torch.exp(-rotation_distance / 0.5)
    rate = w_rate * gate * weight * torch.clamp(shrink, -max_rate, max_rate)

    close = w_close * gate * torch.clamp(1.0 - rotation_distance / close_angle, min=0.0)
    goal = w_goal * torch.where(rotation_distance < 0.1, torch.ones_like(dist), torch.zeros_like(dist))
    down = w_down * torch.clamp(object_linvel[:, 2], -2.0, 0.0)
    vel = -w_vel * torch.mean(shadow_hand_dof_vel ** 2, dim=-1)

    reward = keep + away + rate + close + goal + down + vel
    components = {
        "keep": keep,
        "away": away,
        "rate": rate,
        "close": close,
        "goal": goal,
        "down": down,
        "vel": vel,
        "dist": dist,
    }
    return reward, components
