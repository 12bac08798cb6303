import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, goal_pos: torch.Tensor, rotation_distance: torch.Tensor,
                   object_another_pos: torch.Tensor, goal_another_pos: torch.Tensor,
                   rotation_distance_another: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    pi = 3.14159265
    smallest = 0.05          # rad, where the logarithm levels off
    place_temp = 0.08        # m
    bonus_angle = 0.1        # rad
    w_place, w_turn, w_bonus = 0.6, 1.2, 30.0

    def hand(position, goal, angle):
        place = torch.exp(-torch.norm(position - goal, dim=-1) / place_temp)
        # 0 at pi, 1 at zero angle
        top = torch.log(torch.full_like(angle, (pi + smallest) / smallest))
        share = torch.log((pi + smallest) / (angle + smallest)) / top
        bonus = w_bonus * (angle < bonus_angle).float() * place
        return w_place * place, w_turn * place * share, bonus

    r_place, r_turn, r_bonus = hand(object_pos, goal_pos, rotation_distance)
    l_place, l_turn, l_bonus = hand(object_another_pos, goal_another_pos, rotation_distance_another)

    reward = r_place + l_place + r_turn + l_turn + r_bonus + l_bonus
    components = {
        "right_place": r_place,
        "left_place": l_place,
        "right_turn": r_turn,
        "left_turn": l_turn,
        "right_bonus": r_bonus,
        "left_bonus": l_bonus,
    }
    return reward, components
