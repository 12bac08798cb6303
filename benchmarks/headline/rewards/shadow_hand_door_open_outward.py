import torch
from typing import Dict, Tuple


def compute_reward(right_hand_ff_pos: torch.Tensor, right_hand_mf_pos: torch.Tensor, right_hand_rf_pos: torch.Tensor,
                   right_hand_lf_pos: torch.Tensor, right_hand_th_pos: torch.Tensor,
                   left_hand_ff_pos: torch.Tensor, left_hand_mf_pos: torch.Tensor, left_hand_rf_pos: torch.Tensor,
                   left_hand_lf_pos: torch.Tensor, left_hand_th_pos: torch.Tensor,
                   door_right_handle_pos: torch.Tensor, door_left_handle_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    reach_range = 0.6       # m, beyond this the reach pay is zero
    contact_distance = 0.06
    contact_soft = 0.03
    open_scale = 0.8        # m of separation, of the size of a wide opening
    contact_share = 0.5

    reach_weight = 1.0
    contact_weight = 0.5
    open_weight = 6.0
    base_action_weight = 0.002

    def gaps(tips, handle):
        tips = torch.stack(tips, dim=1)
        return torch.norm(tips - handle.unsqueeze(1), dim=-1)

    right = gaps((right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos),
                 door_right_handle_pos)
    left = gaps((left_hand_ff_pos, left_hand_mf_pos, left_hand_rf_pos, left_hand_lf_pos, left_hand_th_pos),
                door_left_handle_pos)

    right_reach = reach_weight * torch.clamp(1.0 - right.mean(dim=-1) / reach_range, min=0.0)
    left_reach = reach_weight * torch.clamp(1.0 - left.mean(dim=-1) / reach_range, min=0.0)

    right_touch = torch.sigmoid((contact_distance - torch.amin(right, dim=-1)) / contact_soft)
    left_touch = torch.sigmoid((contact_distance - torch.amin(left, dim=-1)) / contact_soft)
    touch = 0.5 * (right_touch + left_touch)
    touch_reward = contact_weight * (right_touch + left_touch)

    separation = torch.norm((door_right_handle_pos - door_left_handle_pos)[:, :2], dim=-1)
    opened = torch.clamp(separation / open_scale, max=1.5)
    open_reward = open_weight * opened * (1.0 - contact_share + contact_share * touch)

    # of the actions only the bases' forces and torques cost
    hands = actions.view(actions.shape[0], 2, -1)
    push_cost = -base_action_weight * torch.sum(hands[..., :6] ** 2, dim=-1).sum(dim=-1)

    reward = right_reach + left_reach + touch_reward + open_reward + push_cost
    components = {
        "right_reach": right_reach,
        "left_reach": left_reach,
        "touch": touch_reward,
        "open": open_reward,
        "push_cost": push_cost,
    }
    return reward, components
