import math

import torch

DISTANCE_WEIGHT = -10.0
RANDOM_GOALS = True
TOLERANCE = 0.0  # [rad], 0 for that of the goals


def compute_reward(object_pos, goal_pos, rotation_distance, actions):
    waypoint = 2.0 * math.asin(math.sin(0.1) * math.cos(math.atan(0.8)))  # [rad]
    tolerance = TOLERANCE or (0.2 if RANDOM_GOALS else waypoint)
    distance = torch.linalg.vector_norm(object_pos - goal_pos, dim=-1)
    turned = 1.0 / (rotation_distance + 0.1)
    effort = actions.square().sum(dim=-1)
    bonus = 250.0 * (rotation_distance <= tolerance)
    reward = DISTANCE_WEIGHT * distance + turned - 0.0002 * effort + bonus
    return reward, {"distance": distance, "turned": turned, "effort": effort, "bonus": bonus}
