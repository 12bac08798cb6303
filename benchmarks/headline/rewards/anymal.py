import torch
from typing import Dict, Tuple


def compute_reward(commands: torch.Tensor, base_linear_velocity: torch.Tensor, base_angular_velocity: torch.Tensor,
                   velocity_error: torch.Tensor, yaw_rate_error: torch.Tensor, up_proj: torch.Tensor,
                   base_height: torch.Tensor, dof_vel: torch.Tensor,
                   contact_forces: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    lin_temp = 0.5           # m/s
    yaw_temp = 0.4           # rad/s
    speed_floor = 0.2        # m/s, avoids dividing by tiny commands
    yaw_floor = 0.2
    low_height = 0.4
    w_alive = 0.3
    w_progress = 0.7
    w_turn = 0.3
    w_lin = 1.5
    w_yaw = 0.8
    w_tilt = 0.5
    w_low = 2.0
    w_bounce = 0.15
    w_rate = 0.0002
    w_hip_contact = 0.1

    cmd_xy = commands[:, :2]
    cmd_speed = torch.sqrt(torch.sum(cmd_xy ** 2, dim=-1) + 1e-8)
    along = torch.sum(base_linear_velocity[:, :2] * cmd_xy, dim=-1) / (cmd_speed + 1e-6)
    progress_fraction = torch.clamp(along, max=1e3)
    progress_fraction = torch.minimum(progress_fraction, cmd_speed) / torch.clamp(cmd_speed, min=speed_floor)
    progress = w_progress * torch.clamp(progress_fraction, min=-1.0, max=1.0)

    cmd_yaw = commands[:, 2]
    yaw_along = base_angular_velocity[:, 2] * torch.sign(cmd_yaw)
    turn_fraction = torch.minimum(yaw_along, torch.abs(cmd_yaw)) / torch.clamp(torch.abs(cmd_yaw), min=yaw_floor)
    turn = w_turn * torch.clamp(turn_fraction, min=-1.0, max=1.0)

    lin_sq = torch.sum(velocity_error ** 2, dim=-1)
    lin_track = w_lin * torch.exp(-lin_sq / lin_temp ** 2)
    yaw_track = w_yaw * torch.exp(-yaw_rate_error ** 2 / yaw_temp ** 2)

    alive = w_alive * torch.ones_like(up_proj)
    tilt = -w_tilt * (1.0 - torch.clamp(up_proj, min=0.0))
    low = -w_low * torch.clamp(low_height - base_height, min=0.0, max=0.3)
    bounce = -w_bounce * torch.clamp(base_linear_velocity[:, 2] ** 2, max=2.0)
    rates = -torch.clamp(w_rate * torch.sum(dof_vel ** 2, dim=-1), max=0.2)

    hips = torch.stack((contact_forces[:, 1], contact_forces[:, 4], contact_forces[:, 7], contact_forces[:, 10]), dim=1)
    hip_touch = (torch.norm(hips, dim=-1) > 1.0).float().sum(dim=-1)
    hip_contact = -w_hip_contact * hip_touch

    reward = progress + turn + lin_track + yaw_track + alive + tilt + low + bounce + rates + hip_contact

    components = {
        "progress": progress,
        "turn": turn,
        "lin_track": lin_track,
        "yaw_track": yaw_track,
        "alive": alive,
        "tilt": tilt,
        "low": low,
        "bounce": bounce,
        "joint_rates": rates,
        "hip_contact": hip_contact,
    }
    return reward, components
