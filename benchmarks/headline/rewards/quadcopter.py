import torch
from typing import Dict, Tuple


def compute_reward(root_positions: torch.Tensor, target_position: torch.Tensor, linear_velocity: torch.Tensor,
                   angular_velocity: torch.Tensor, up_proj: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    gain = 1.5            # desired speed per metre of error
    max_speed = 2.0
    track_temp = 1.0
    pos_temp = 0.8
    spin_temp = 3.0
    w_pos = 2.0
    w_track = 0.6
    w_up = 0.3
    w_spin = 0.2
    w_act = 0.01

    err = target_position - root_positions
    dist = torch.norm(err, dim=-1)
    direction = err / (dist.unsqueeze(-1) + 1e-6)
    desired = direction * torch.clamp(gain * dist, max=max_speed).unsqueeze(-1)
    track_err = torch.norm(linear_velocity - desired, dim=-1)

    r_pos = w_pos * torch.exp(-dist / pos_temp)
    r_track = w_track * torch.exp(-track_err / track_temp)
    r_up = w_up * torch.clamp(up_proj, 0.0, 1.0)
    r_spin = w_spin * torch.exp(-torch.norm(angular_velocity, dim=-1) / spin_temp)
    r_act = -w_act * torch.mean(actions * actions, dim=-1)

    reward = r_pos + r_track + r_up + r_spin + r_act
    components = {
        "position": r_pos,
        "velocity_tracking": r_track,
        "upright": r_up,
        "low_spin": r_spin,
        "action_cost": r_act,
    }
    return reward, components
