import torch
from typing import Dict, Tuple


def _turn_rate(object_rot: torch.Tensor, goal_rot: torch.Tensor, angvel: torch.Tensor) -> torch.Tensor:
    """Rate [rad/s] at which the turn left to the goal shrinks."""
    left = quat_mul(goal_rot, quat_conjugate(object_rot))
    flip = torch.where(left[:, 3] < 0, -torch.ones_like(left[:, 3]), torch.ones_like(left[:, 3]))
    vec = left[:, :3] * flip.unsqueeze(-1)
    axis = vec / torch.clamp(torch.norm(vec, dim=-1, keepdim=True), min=1e-4)
    return torch.sum(angvel * axis, dim=-1)


def compute_reward(
    object_pos: torch.Tensor,
    object_rot: torch.Tensor,
    object_angvel: torch.Tensor,
    goal_pos: torch.Tensor,
    goal_rot: torch.Tensor,
    rotation_distance: torch.Tensor,
    fingertip_pos: torch.Tensor,
    actions: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    pos_temp, tip_temp, wide_temp, sharp_temp, rate_scale = 0.05, 0.06, 1.0, 0.2, 2.0
    reached = 0.1
    w_hold, w_tips, w_wide, w_sharp, w_rate, w_reach, w_fall, w_act = 0.6, 0.3, 0.5, 0.5, 0.4, 30.0, 3.0, 0.01

    dist = torch.norm(object_pos - goal_pos, dim=-1)
    hold_quality = torch.exp(-dist / pos_temp)
    hold = w_hold * hold_quality
    tip_dist = torch.mean(torch.norm(fingertip_pos - object_pos.unsqueeze(1), dim=-1), dim=-1)
    tips = w_tips * torch.exp(-tip_dist / tip_temp)

    in_hand = torch.sigmoid((0.10 - dist) / 0.02)
    wide = w_wide * in_hand * torch.exp(-rotation_distance / wide_temp)
    sharp = w_sharp * in_hand * torch.exp(-rotation_distance / sharp_temp)
    rate = w_rate * in_hand * torch.clamp(_turn_rate(object_rot, goal_rot, object_angvel) / rate_scale, -1.0, 1.0)

    reach = w_reach * torch.where(
        rotation_distance < reached, torch.ones_like(rotation_distance), torch.zeros_like(rotation_distance)
    )
    fall = -w_fall * torch.where(dist > 0.20, torch.ones_like(dist), torch.zeros_like(dist))
    act = -w_act * torch.mean(actions ** 2, dim=-1)

    reward = hold + tips + wide + sharp + rate + reach + fall + act
    components = {
        "hold": hold,
        "tips": tips,
        "wide": wide,
        "sharp": sharp,
        "rate": rate,
        "reach": reach,
        "fall": fall,
        "act": act,
        "dist": dist,
    }
    return reward, components
