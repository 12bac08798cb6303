import torch
from typing import Dict, Tuple


def compute_reward(cart_position: torch.Tensor, cart_velocity: torch.Tensor, pole_angle: torch.Tensor,
                   pole_velocity: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    angle_temperature = 0.2
    position_temperature = 1.0
    w_alive = 1.0
    w_upright = 1.0
    w_centre = 0.5
    w_pole_rate = 0.01
    w_cart_rate = 0.01

    alive = w_alive * torch.ones_like(pole_angle)
    upright = w_upright * torch.exp(-torch.abs(pole_angle) / angle_temperature)
    centre = w_centre * torch.exp(-torch.abs(cart_position) / position_temperature)
    pole_rate = -w_pole_rate * torch.clamp(torch.abs(pole_velocity), max=10.0)
    cart_rate = -w_cart_rate * torch.clamp(torch.abs(cart_velocity), max=10.0)

    reward = alive + upright + centre + pole_rate + cart_rate
    components = {
        "alive": alive, "upright": upright, "centre": centre,
        "pole_rate": pole_rate, "cart_rate": cart_rate,
    }
    return reward, components
