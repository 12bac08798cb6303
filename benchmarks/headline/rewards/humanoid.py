import torch
from typing import Dict, Tuple


def compute_reward(torso_velocity: torch.Tensor, torso_height: torch.Tensor, up_proj: torch.Tensor,
                   heading_proj: torch.Tensor, actions: torch.Tensor,
                   dof_pos: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    w_speed = 2.0
    w_balance = 1.5
    w_heading = 0.5
    w_hip_side = 0.1
    w_effort = 0.1
    tilt_temperature = 0.25
    height_temperature = 0.25

    vx = torso_velocity[:, 0]
    upright = torch.exp(-torch.clamp(0.97 - up_proj, min=0.0) / tilt_temperature)
    tall = torch.exp(-torch.clamp(1.2 - torso_height, min=0.0) / height_temperature)
    balance = w_balance * (0.5 + 0.5 * upright * tall)

    speed = w_speed * torch.clamp(vx, -1.5, 12.0) * (0.4 + 0.6 * upright)
    heading = w_heading * heading_proj * (0.5 + 0.5 * torch.sigmoid(2.0 * vx - 1.0))

    # hip x and z joints of both legs: splayed or twisted legs do not run
    splay = torch.square(dof_pos[:, 3]) + torch.square(dof_pos[:, 4])
    splay = splay + torch.square(dof_pos[:, 9]) + torch.square(dof_pos[:, 10])
    hip_side = -w_hip_side * torch.clamp(splay, max=3.0)
    effort = -w_effort * torch.mean(torch.square(actions), dim=-1)

    reward = speed + balance + heading + hip_side + effort
    components = {
        "speed": speed, "balance": balance, "heading": heading,
        "hip_side": hip_side, "effort": effort,
    }
    return reward, components
