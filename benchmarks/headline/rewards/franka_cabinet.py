import torch
from typing import Dict, Tuple


def compute_reward(franka_grasp_pos: torch.Tensor, drawer_grasp_pos: torch.Tensor, drawer_opening: torch.Tensor,
                   left_finger_above_handle: torch.Tensor, right_finger_below_handle: torch.Tensor,
                   gripper_forward_proj: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    dist_scale = 0.12
    full_opening = 0.4
    side_scale = 0.02
    w_dist = 1.0
    w_side = 0.3
    w_forward = 0.3
    w_first = 2.0
    w_open = 6.0

    d = torch.norm(franka_grasp_pos - drawer_grasp_pos, dim=-1)
    near = 1.0 / (1.0 + (d / dist_scale) ** 2)
    left_ok = torch.tanh(left_finger_above_handle / side_scale)
    right_ok = torch.tanh(right_finger_below_handle / side_scale)
    opened = torch.clamp(drawer_opening / full_opening, 0.0, 1.0)

    r_dist = w_dist * near
    r_side = w_side * near * torch.minimum(left_ok, right_ok)
    r_forward = w_forward * near * gripper_forward_proj
    r_first = w_first * (torch.sqrt(opened + 1e-4) - 0.01)
    r_open = w_open * opened

    reward = r_dist + r_side + r_forward + r_first + r_open
    components = {
        "distance": r_dist,
        "fingers_on_both_sides": r_side,
        "forward": r_forward,
        "first_opening": r_first,
        "opening": r_open,
    }
    return reward, components
