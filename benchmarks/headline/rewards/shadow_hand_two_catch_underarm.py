import torch
from typing import Dict, Tuple


def compute_reward(
    object_pos: torch.Tensor,
    object_linvel: torch.Tensor,
    goal_pos: torch.Tensor,
    object_another_pos: torch.Tensor,
    object_another_linvel: torch.Tensor,
    goal_another_pos: torch.Tensor,
    rotation_distance: torch.Tensor,
    rotation_distance_another: torch.Tensor,
    actions: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    gravity = 9.81
    full_time, gap = 0.32, 0.40
    vel_temp = 1.0
    coarse_temp, fine_temp = 0.20, 0.04
    rot_temp = 1.0
    w_vel, w_coarse, w_fine, w_worst, w_rot, w_act = 0.8, 1.0, 2.0, 3.0, 0.3, 0.005

    pos = torch.stack((object_pos, object_another_pos), dim=1)  # (N, 2, 3)
    vel = torch.stack((object_linvel, object_another_linvel), dim=1)
    goal = torch.stack((goal_pos, goal_another_pos), dim=1)
    rot = torch.stack((rotation_distance, rotation_distance_another), dim=1)

    offset = goal - pos
    dist = torch.norm(offset, dim=-1)
    flat_dist = torch.norm(offset[..., :2], dim=-1)

    # time left shrinks with the way left
    time = torch.clamp(full_time * flat_dist / gap, 0.08, full_time).unsqueeze(-1)
    lift = torch.cat((torch.zeros_like(offset[..., :2]), 0.5 * gravity * time), dim=-1)
    wanted = offset / time + lift
    mismatch = torch.norm(vel - wanted, dim=-1)
    rest_mismatch = torch.norm(wanted, dim=-1)
    flying = torch.sigmoid((flat_dist - 0.10) / 0.02)
    # zero for an egg that lies still, positive for one that goes the right way
    match = flying * torch.clamp(
        torch.exp(-mismatch / vel_temp) - torch.exp(-rest_mismatch / vel_temp), min=-0.2
    )

    coarse = torch.exp(-dist / coarse_temp) - torch.exp(torch.full_like(dist, -gap / coarse_temp))
    fine = torch.exp(-dist / fine_temp)
    turned = fine * torch.exp(-rot / rot_temp)

    velocity_term = w_vel * torch.mean(match, dim=-1)
    coarse_term = w_coarse * torch.mean(coarse, dim=-1)
    fine_term = w_fine * torch.mean(fine, dim=-1)
    worst_dist = torch.amax(dist, dim=-1)
    worst_term = w_worst * torch.exp(-worst_dist / 0.07)
    rot_term = w_rot * torch.mean(turned, dim=-1)
    action_term = -w_act * torch.mean(actions ** 2, dim=-1)

    reward = velocity_term + coarse_term + fine_term + worst_term + rot_term + action_term
    components = {
        "velocity_match": velocity_term,
        "coarse": coarse_term,
        "fine": fine_term,
        "worst": worst_term,
        "rotation": rot_term,
        "action": action_term,
        "worst_dist": worst_dist,
    }
    return reward, components
