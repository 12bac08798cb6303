import torch
from typing import Dict, Tuple


def _landing_error(pos: torch.Tensor, vel: torch.Tensor, goal: torch.Tensor) -> torch.Tensor:
    gravity = 9.81
    drop = pos[:, 2] - goal[:, 2]
    inside = torch.clamp(vel[:, 2] ** 2 + 2.0 * gravity * drop, min=0.0)
    time = torch.clamp((vel[:, 2] + torch.sqrt(inside)) / gravity, 0.0, 0.6)
    landing = pos[:, :2] + vel[:, :2] * time.unsqueeze(-1)
    return torch.norm(landing - goal[:, :2], dim=-1)


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
    gap = 0.40
    near_temp, landing_temp, rot_temp = 0.06, 0.15, 1.0
    w_progress, w_landing, w_near, w_both, w_rot, w_action = 1.0, 0.6, 1.5, 3.0, 0.3, 0.01

    dist_a = torch.norm(object_pos - goal_pos, dim=-1)
    dist_b = torch.norm(object_another_pos - goal_another_pos, dim=-1)

    progress_a = torch.clamp(1.0 - dist_a / gap, -0.5, 1.0)
    progress_b = torch.clamp(1.0 - dist_b / gap, -0.5, 1.0)
    near_a = torch.exp(-dist_a / near_temp)
    near_b = torch.exp(-dist_b / near_temp)

    # baseline: an egg at rest in its own hand has a landing error of about 0.4 m
    base = torch.exp(torch.full_like(dist_a, -gap / landing_temp))
    aim_a = torch.exp(-_landing_error(object_pos, object_linvel, goal_pos) / landing_temp) - base
    aim_b = torch.exp(-_landing_error(object_another_pos, object_another_linvel, goal_another_pos) / landing_temp) - base

    progress = w_progress * 0.5 * (progress_a + progress_b)
    aim = w_landing * 0.5 * (aim_a + aim_b)
    near = w_near * 0.5 * (near_a + near_b)
    both = w_both * torch.minimum(near_a, near_b)
    turn = w_rot * 0.5 * (
        near_a * torch.exp(-rotation_distance / rot_temp) + near_b * torch.exp(-rotation_distance_another / rot_temp)
    )
    effort = -w_action * torch.mean(actions ** 2, dim=-1)

    reward = progress + aim + near + both + turn + effort
    components = {
        "progress": progress,
        "aim": aim,
        "near": near,
        "both": both,
        "turn": turn,
        "effort": effort,
        "dist_a": dist_a,
        "dist_b": dist_b,
    }
    return reward, components
