import torch
from typing import Dict, Tuple


def predicted_miss(position: torch.Tensor, velocity: torch.Tensor, goal: torch.Tensor) -> torch.Tensor:
    """Smallest distance from the goal over the next 0.5 s of free flight."""
    gravity = 9.81
    steps = torch.linspace(0.0, 0.5, 21, device=position.device)
    time = steps.view(1, 21, 1)
    path = position.unsqueeze(1) + velocity.unsqueeze(1) * time
    fall = torch.stack((torch.zeros_like(steps), torch.zeros_like(steps), 0.5 * gravity * steps * steps), dim=-1)
    path = path - fall.unsqueeze(0)
    return torch.amin(torch.norm(path - goal.unsqueeze(1), dim=-1), dim=-1)


def compute_reward(object_pos: torch.Tensor, object_linvel: torch.Tensor, goal_pos: torch.Tensor,
                   rotation_distance: torch.Tensor, left_hand_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    miss_temperature = 0.2
    distance_temperature = 0.12
    fine_temperature = 0.03
    w_miss = 1.2
    w_distance = 2.0
    w_fine = 3.0
    w_rotation = 0.5
    w_still = 0.5
    w_action = 0.01

    miss = predicted_miss(object_pos, object_linvel, goal_pos)
    distance = torch.norm(object_pos - goal_pos, dim=-1)
    # at the start the miss is 0.6 m, and exp(-3) = 0.05
    miss_pay = w_miss * (torch.exp(-miss / miss_temperature) - 0.05)
    distance_pay = w_distance * torch.exp(-distance / distance_temperature)
    close = torch.exp(-distance / fine_temperature)
    fine = w_fine * close
    rotation = w_rotation * torch.exp(-distance / 0.06) * torch.exp(-rotation_distance / 1.0)
    held = torch.exp(-torch.norm(object_pos - left_hand_pos, dim=-1) / 0.07)
    still = w_still * held * torch.exp(-torch.norm(object_linvel, dim=-1) / 0.4)
    action = -w_action * torch.mean(torch.square(actions), dim=-1)

    reward = miss_pay + distance_pay + fine + rotation + still + action
    components = {
        "miss_pay": miss_pay, "distance_pay": distance_pay, "fine": fine, "rotation": rotation,
        "still": still, "action": action, "miss": miss, "distance": distance,
    }
    return reward, components
