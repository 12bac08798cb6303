import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, block_right_handle_pos: torch.Tensor, block_left_handle_pos: torch.Tensor,
                   fingertip_pos: torch.Tensor, fingertip_another_pos: torch.Tensor, left_hand_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    block_rest = 0.62        # m
    lift_full = 0.15         # m
    reach_temp = 0.12        # m
    carry_temp = 0.3         # m
    inside_temp = 0.05       # m
    w_right, w_left, w_palm = 0.4, 0.8, 0.2
    palm_temp = 0.15
    w_lift = 1.5
    w_carry = 2.0
    w_inside = 5.0
    w_action = 0.0008

    right_d = torch.norm(fingertip_pos - block_right_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left_d = torch.norm(fingertip_another_pos - block_left_handle_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    right_reach = w_right * torch.exp(-right_d / reach_temp)
    left_near = torch.exp(-left_d / reach_temp)
    left_reach = w_left * left_near
    palm_reach = w_palm * torch.exp(-torch.norm(left_hand_pos - block_left_handle_pos, dim=-1) / palm_temp)

    to_bucket = torch.norm(block_left_handle_pos - object_pos, dim=-1)
    inside_share = torch.exp(-(to_bucket / inside_temp) ** 2)
    height = torch.clamp((block_left_handle_pos[:, 2] - block_rest) / lift_full, min=0.0, max=1.0)
    # once the block is in, the low position is as good as the lifted one
    lift = w_lift * torch.maximum(height, inside_share)
    carry = w_carry * torch.exp(-to_bucket / carry_temp) * (0.3 + 0.7 * torch.maximum(height, inside_share))
    inside = w_inside * inside_share

    action_cost = -w_action * torch.sum(actions ** 2, dim=-1)

    reward = right_reach + left_reach + palm_reach + lift + carry + inside + action_cost
    components = {
        "right_reach": right_reach,
        "left_reach": left_reach,
        "palm_reach": palm_reach,
        "lift": lift,
        "carry": carry,
        "inside": inside,
        "action_cost": action_cost,
    }
    return reward, components
