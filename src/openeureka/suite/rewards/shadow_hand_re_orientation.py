import torch


def compute_reward(
    object_pos, goal_pos, rotation_distance, object_another_pos, goal_another_pos, rotation_distance_another, actions
):
    first = torch.linalg.vector_norm(object_pos - goal_pos, dim=-1)
    second = torch.linalg.vector_norm(object_another_pos - goal_another_pos, dim=-1)
    distance = first + second
    turned = 1.0 / (rotation_distance + 0.1) + 1.0 / (rotation_distance_another + 0.1)
    effort = actions.square().sum(dim=-1)
    bonus = 500.0 * (torch.minimum(rotation_distance, rotation_distance_another) < 0.1)
    reward = -10.0 * distance + turned - 0.0002 * effort + bonus
    return reward, {"distance": distance, "turned": turned, "effort": effort, "bonus": bonus}
