import torch
from typing import Dict, Tuple


def compute_reward(
    right_hand_pos: torch.Tensor,
    left_hand_pos: torch.Tensor,
    fingertip_pos: torch.Tensor,
    fingertip_another_pos: torch.Tensor,
    bottle_pos: torch.Tensor,
    bottle_cap_pos: torch.Tensor,
    bottle_cap_up: torch.Tensor,
    actions: torch.Tensor,
) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    finger_temp, palm_temp, hold_temp = 0.06, 0.12, 0.08
    travel_scale = 0.03
    w_palm, w_finger, w_hold, w_travel, w_far, w_height, w_act = 0.3, 0.8, 0.4, 2.0, 2.0, 0.3, 0.01

    axis = bottle_cap_pos - bottle_pos
    axis = axis / torch.clamp(torch.norm(axis, dim=-1), min=1e-4).unsqueeze(-1)
    shift = bottle_cap_up - bottle_pos
    travel = torch.sum(shift * axis, dim=-1)
    cap = bottle_cap_pos + torch.clamp(travel, min=0.0).unsqueeze(-1) * axis

    palm_dist = torch.norm(right_hand_pos - cap, dim=-1)
    palm = w_palm * torch.exp(-palm_dist / palm_temp)
    tip_dist = torch.mean(torch.norm(fingertip_pos - cap.unsqueeze(1), dim=-1), dim=-1)
    finger = w_finger * torch.exp(-tip_dist / finger_temp)

    left_palm = torch.norm(left_hand_pos - bottle_pos, dim=-1)
    left_tips = torch.mean(torch.norm(fingertip_another_pos - bottle_pos.unsqueeze(1), dim=-1), dim=-1)
    hold = w_hold * 0.5 * (torch.exp(-left_palm / hold_temp) + torch.exp(-left_tips / hold_temp))

    opened = w_travel * torch.clamp(travel / travel_scale, -0.2, 1.0)
    far = w_far * torch.clamp((travel - travel_scale) / travel_scale, 0.0, 2.0)
    height = w_height * torch.clamp((bottle_cap_pos[:, 2] - 0.5) / 0.12, 0.0, 1.0)
    act = -w_act * torch.mean(actions ** 2, dim=-1)

    reward = palm + finger + hold + opened + far + height + act
    components = {
        "palm": palm,
        "finger": finger,
        "hold": hold,
        "opened": opened,
        "far": far,
        "height": height,
        "act": act,
        "travel": travel,
        "tip_dist": tip_dist,
    }
    return reward, components
