import torch
from typing import Dict, Tuple


def compute_reward(
    object_pos: torch.Tensor,
    object_linvel: torch.Tensor,
    goal_pos: torch.Tensor,
    right_hand_pos: torch.Tensor,
    left_hand_pos: torch.Tensor,
    pot_right_handle_pos: torch.Tensor,
    pot_left_handle_pos: torch.Tensor,
    fingertip_pos: torch.Tensor,
    fingertip_another_pos: torch.Tensor,
    actions: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    start_dist, gentle = 0.38, 0.5
    palm_temp, tip_temp = 0.07, 0.07
    w_palm, w_tips, w_linear, w_square, w_rate, w_inside, w_edge, w_act = 0.4, 0.4, 1.5, 1.0, 0.4, 3.0, 0.4, 0.01

    palm_r = torch.norm(right_hand_pos - pot_right_handle_pos, dim=-1)
    palm_l = torch.norm(left_hand_pos - pot_left_handle_pos, dim=-1)
    palm = w_palm * torch.exp(-0.5 * (palm_r + palm_l) / palm_temp)

    tip_r = torch.mean(torch.norm(fingertip_pos - pot_right_handle_pos.unsqueeze(1), dim=-1), dim=-1)
    tip_l = torch.mean(torch.norm(fingertip_another_pos - pot_left_handle_pos.unsqueeze(1), dim=-1), dim=-1)
    tips = w_tips * torch.exp(-0.5 * (tip_r + tip_l) / tip_temp)

    offset = goal_pos - object_pos
    dist = torch.norm(offset, dim=-1)
    share = torch.clamp(1.0 - dist / start_dist, 0.0, 1.0)
    linear = w_linear * share
    square = w_square * share ** 2

    closing = torch.sum(object_linvel * offset, dim=-1) / torch.clamp(dist, min=0.02)
    rate = w_rate * torch.clamp(dist / 0.1, max=1.0) * torch.clamp(closing / gentle, -1.0, 1.0)

    inside = w_inside * torch.sigmoid((0.05 - dist) / 0.015)
    # warn before a palm gets 0.2 m away from its handle
    edge = -w_edge * torch.clamp((torch.maximum(palm_r, palm_l) - 0.16) / 0.04, 0.0, 1.0)
    act = -w_act * torch.mean(actions ** 2, dim=-1)

    reward = palm + tips + linear + square + rate + inside + edge + act
    components = {
        "palm": palm,
        "tips": tips,
        "linear": linear,
        "square": square,
        "rate": rate,
        "inside": inside,
        "edge": edge,
        "act": act,
        "goal_dist": dist,
    }
    return reward, components
