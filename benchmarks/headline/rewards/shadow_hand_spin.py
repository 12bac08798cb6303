import torch
from typing import Dict, Tuple


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
    place_temp, wide_temp, sharp_temp, tip_temp, rate_scale = 0.10, 1.0, 0.2, 0.08, 2.0
    w_place, w_tips, w_wide, w_sharp, w_rate, w_goal, w_fall, w_act = 0.4, 0.1, 0.5, 0.5, 0.5, 50.0, 10.0, 0.01

    dist = torch.norm(object_pos - goal_pos, dim=-1)
    in_hand = torch.sigmoid((0.15 - dist) / 0.02)
    place = w_place * torch.exp(-dist / place_temp)
    tip_dist = torch.mean(torch.norm(fingertip_pos - object_pos.unsqueeze(1), dim=-1), dim=-1)
    tips = w_tips * torch.exp(-tip_dist / tip_temp)

    wide = w_wide * in_hand * torch.exp(-rotation_distance / wide_temp)
    sharp = w_sharp * in_hand * torch.exp(-rotation_distance / sharp_temp)

    left = quat_mul(goal_rot, quat_conjugate(object_rot))
    vec = left[:, :3] * torch.where(left[:, 3:] < 0, -torch.ones_like(left[:, 3:]), torch.ones_like(left[:, 3:]))
    axis = vec / torch.clamp(torch.norm(vec, dim=-1, keepdim=True), min=1e-4)
    rate = w_rate * in_hand * torch.clamp(torch.sum(object_angvel * axis, dim=-1) / rate_scale, -1.0, 1.0)

    goal = w_goal * torch.where(rotation_distance < 0.1, torch.ones_like(dist), torch.zeros_like(dist))
    fall = -w_fall * torch.where(dist > 0.22, torch.ones_like(dist), torch.zeros_like(dist))
    act = -w_act * torch.mean(actions ** 2, dim=-1)

    reward = place + tips + wide + sharp + rate + goal + fall + act
    components = {
        "place": place,
        "tips": tips,
        "wide": wide,
        "sharp": sharp,
        "rate": rate,
        "goal": goal,
        "fall": fall,
        "act": act,
        "dist": dist,
    }
    return reward, components
