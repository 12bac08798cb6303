import torch
from typing import Dict, Tuple


def compute_reward(switch_right_handle_pos: torch.Tensor, switch_left_handle_pos: torch.Tensor,
                   root_state_tensor: torch.Tensor, object_pos: torch.Tensor,
                   right_hand_ff_pos: torch.Tensor, right_hand_mf_pos: torch.Tensor, right_hand_rf_pos: torch.Tensor,
                   left_hand_ff_pos: torch.Tensor, left_hand_mf_pos: torch.Tensor, left_hand_rf_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    start_height = 0.052     # m, handle over housing when not pressed
    full_travel = 0.03       # m
    reach_temp = 0.08        # m
    w_reach = 0.5
    w_press = 3.0
    w_both = 2.0
    w_action = 0.001

    def reach(tips, handle):
        dist = torch.norm(tips - handle.unsqueeze(1), dim=-1)
        return torch.exp(-dist.mean(dim=-1) / reach_temp) * 0.5 + torch.exp(-dist.amin(dim=-1) / reach_temp) * 0.5

    right_tips = torch.stack((right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos), dim=1)
    left_tips = torch.stack((left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos), dim=1)
    right_reach = w_reach * reach(right_tips, switch_right_handle_pos)
    left_reach = w_reach * reach(left_tips, switch_left_handle_pos)

    left_housing = root_state_tensor[:, 3, :3]
    right_sunk = start_height - (switch_right_handle_pos[:, 2] - object_pos[:, 2])
    left_sunk = start_height - (switch_left_handle_pos[:, 2] - left_housing[:, 2])
    right_share = torch.clamp(right_sunk / full_travel, min=-0.2, max=1.5)
    left_share = torch.clamp(left_sunk / full_travel, min=-0.2, max=1.5)
    right_press = w_press * right_share
    left_press = w_press * left_share
    both = w_both * torch.clamp(torch.minimum(right_share, left_share), min=0.0)

    action_cost = -w_action * torch.sum(actions ** 2, dim=-1)

    reward = right_reach + left_reach + right_press + left_press + both + action_cost
    components = {
        "right_reach": right_reach,
        "left_reach": left_reach,
        "right_press": right_press,
        "left_press": left_press,
        "both": both,
        "action_cost": action_cost,
    }
    return reward, components
