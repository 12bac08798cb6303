import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, object_linvel: torch.Tensor, goal_pos: torch.Tensor,
                   right_base_pos: torch.Tensor, dof_vel: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    gravity = 9.81
    flight_time = 0.35       # s for the whole way of 0.45 m
    whole_way = 0.45         # m
    shortest_time = 0.05     # s
    match_temp = 1.0         # m/s
    blend_distance, blend_width = 0.2, 0.05   # m
    distance_temp = 0.15     # m
    fine_temp = 0.04         # m
    slow_temp = 0.8          # m/s
    w_match, w_distance, w_fine, w_slow = 0.6, 2.0, 3.0, 1.5
    w_vel = 0.00002

    offset = goal_pos - object_pos
    distance = torch.norm(offset, dim=-1)
    horizontal_distance = torch.norm(offset[:, :2], dim=-1)

    time = torch.clamp(flight_time * horizontal_distance / whole_way, min=shortest_time, max=0.6)
    wanted_horizontal = offset[:, :2] / time.unsqueeze(-1)
    wanted_vertical = offset[:, 2] / time + 0.5 * gravity * time
    horizontal_error = torch.norm(wanted_horizontal - object_linvel[:, :2], dim=-1)
    vertical_error = torch.abs(wanted_vertical - object_linvel[:, 2])
    away = torch.sigmoid((distance - blend_distance) / blend_width)
    match = w_match * away * torch.exp(-(horizontal_error + 0.3 * vertical_error) / match_temp)

    at_goal = w_distance * torch.exp(-distance / distance_temp)
    near = torch.exp(-distance / fine_temp)
    exact = w_fine * near
    speed = torch.norm(object_linvel, dim=-1)
    slow = w_slow * torch.exp(-distance / distance_temp) * (1.0 - away) * torch.exp(-speed / slow_temp)
    velocity_cost = -torch.clamp(w_vel * torch.sum(dof_vel ** 2, dim=-1), max=0.1)

    reward = match + at_goal + exact + slow + velocity_cost
    components = {
        "match": match,
        "at_goal": at_goal,
        "exact": exact,
        "slow": slow,
        "velocity_cost": velocity_cost,
    }
    return reward, components
