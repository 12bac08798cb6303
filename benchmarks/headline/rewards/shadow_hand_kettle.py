import torch
from typing import Dict, Tuple


def compute_reward(
    right_hand_pos: torch.Tensor,
    left_hand_pos: torch.Tensor,
    right_hand_ff_pos: torch.Tensor,
    right_hand_mf_pos: torch.Tensor,
    right_hand_rf_pos: torch.Tensor,
    right_hand_lf_pos: torch.Tensor,
    right_hand_th_pos: torch.Tensor,
    left_hand_ff_pos: torch.Tensor,
    left_hand_mf_pos: torch.Tensor,
    left_hand_th_pos: torch.Tensor,
    kettle_handle_pos: torch.Tensor,
    kettle_spout_pos: torch.Tensor,
    bucket_handle_pos: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    start_gap = 0.22
    reach_scale, tip_temp, near_temp = 0.30, 0.07, 0.05
    w_reach, w_grip, w_left, w_gap, w_near, w_height = 0.5, 0.6, 0.5, 2.5, 3.0, 0.5

    right_dist = torch.norm(right_hand_pos - kettle_handle_pos, dim=-1)
    reach = w_reach * torch.clamp(1.0 - right_dist / reach_scale, -1.0, 1.0)

    tips = torch.stack(
        (right_hand_ff_pos, right_hand_mf_pos, right_hand_rf_pos, right_hand_lf_pos, right_hand_th_pos), dim=1
    )
    tip_dist = torch.norm(tips - kettle_handle_pos.unsqueeze(1), dim=-1)
    grip = w_grip * torch.mean(torch.exp(-tip_dist / tip_temp), dim=-1)

    left_dist = torch.norm(left_hand_pos - bucket_handle_pos, dim=-1)
    left_tips = torch.stack((left_hand_ff_pos, left_hand_mf_pos, left_hand_th_pos), dim=1)
    left_tip_dist = torch.mean(torch.norm(left_tips - bucket_handle_pos.unsqueeze(1), dim=-1), dim=-1)
    left = w_left * 0.5 * (torch.exp(-left_dist / 0.20) + torch.exp(-left_tip_dist / 0.15))

    gap = torch.norm(kettle_spout_pos - bucket_handle_pos, dim=-1)
    closing = w_gap * torch.clamp(1.0 - gap / start_gap, -1.0, 1.0)
    near = w_near * torch.exp(-gap / near_temp)
    # the bucket must not fall
    height = -w_height * torch.clamp((0.33 - bucket_handle_pos[:, 2]) / 0.13, 0.0, 1.0)

    reward = reach + grip + left + closing + near + height
    components = {
        "reach": reach,
        "grip": grip,
        "left": left,
        "closing": closing,
        "near": near,
        "height": height,
        "gap": gap,
    }
    return reward, components
