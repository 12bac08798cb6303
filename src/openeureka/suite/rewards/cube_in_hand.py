import torch

TOLERANCE = 0.1  # [rad]


def compute_reward(object_pos, goal_pos, rotation_distance, actions):
    distance = torch.linalg.vector_norm(object_pos - goal_pos, dim=-1)
    turned = 1.0 / (rotation_distance + 0.1)
    effort = actions.square().sum(dim=-1)
    bonus = 250.0 * (rotation_distance <= TOLERANCE)
    reward = -10.0 * distance + turned - 0.0002 * effort + bonus
    return reward, {"distance": distance, "turned": turned, "effort": effort, "bonus": bonus}
