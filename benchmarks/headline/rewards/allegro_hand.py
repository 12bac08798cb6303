import torch
from typing import Dict, Tuple


def compute_reward(
    object_pos: torch.Tensor,
    object_angvel: torch.Tensor,
    goal_pos: torch.Tensor,
    rotation_distance: torch.Tensor,
    actions: torch.Tensor,
    shadow_hand_dof_vel: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    palm, pos_temp = 0.05, 0.05
    t_far, t_mid, t_near = 1.5, 0.5, 0.15
    edge, width = 0.12, 0.02
    w_pos, w_far, w_mid, w_near, w_bonus, w_wild, w_act, w_vel = 0.2, 0.4, 0.4, 0.4, 30.0, 0.02, 0.005, 0.0002

    dist = torch.norm(object_pos - goal_pos, dim=-1)
    held = torch.exp(-torch.clamp(dist - palm, min=0.0) / pos_temp)
    pos = w_pos * held
    far = w_far * held * torch.exp(-rotation_distance / t_far)
    mid = w_mid * held * torch.exp(-rotation_distance / t_mid)
    near = w_near * held * torch.exp(-rotation_distance / t_near)
    bonus = w_bonus * torch.sigmoid((edge - rotation_distance) / width)

    wild = -w_wild * torch.clamp(torch.norm(object_angvel, dim=-1) - 6.0, 0.0, 20.0)
    act = -w_act * torch.mean(actions ** 2, dim=-1)
    vel = -w_vel * torch.mean(shadow_hand_dof_vel ** 2, dim=-1)

    reward = pos + far + mid + near + bonus + wild + act + vel
    components = {
        "pos": pos,
        "far": far,
        "mid": mid,
        "near": near,
        "bonus": bonus,
        "wild": wild,
        "act": act,
        "vel": vel,
        "dist": dist,
    }
    return reward, components
