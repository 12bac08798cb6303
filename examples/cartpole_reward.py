"""A reward a person could write: stay upright, stay near the middle.

eureka check env=cartpole examples/cartpole_reward.py
eureka train env=cartpole reward=human,examples/cartpole_reward.py
"""

import torch
from torch import Tensor


@torch.jit.script
def compute_reward(pole_angle: Tensor, cart_position: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
    upright = torch.exp(-10.0 * pole_angle**2)
    centred = torch.exp(-(cart_position**2))
    reward = upright + 0.2 * centred
    return reward, {"upright": upright, "centred": centred}
