import torch
from typing import Dict, Tuple


def compute_reward(root_states: torch.Tensor, heading_vec: torch.Tensor, up_vec: torch.Tensor,
                   torso_height: torch.Tensor, heading_proj: torch.Tensor,
                   actions: torch.Tensor, dof_vel: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    w_world = 1.0
    w_facing = 0.6
    w_stand = 0.4
    low_height = 0.32
    height_width = 0.03
    w_heading = 0.1
    w_power = 0.001

    vel = root_states[:, 7:10]
    vx = vel[:, 0]
    facing = torch.clamp(heading_proj, 0.0, 1.0)
    body_forward = torch.sum(vel[:, :2] * heading_vec[:, :2], dim=-1)

    standing = torch.sigmoid((torso_height - low_height) / height_width) * torch.clamp(up_vec[:, 2], 0.0, 1.0)

    r_world = w_world * vx
    r_facing = w_facing * facing * torch.clamp(torch.minimum(vx, body_forward), min=0.0)
    r_stand = w_stand * standing
    r_heading = w_heading * heading_proj
    c_power = -w_power * torch.clamp(torch.sum(torch.abs(actions * dof_vel), dim=-1), max=200.0)

    reward = r_world + r_facing + r_stand + r_heading + c_power
    components = {
        "world_speed": r_world,
        "facing_speed": r_facing,
        "standing": r_stand,
        "heading": r_heading,
        "power_cost": c_power,
    }
    return reward, components
