import torch


def compute_reward(object_pos, goal_pos, rotation_distance):
    distance = torch.linalg.vector_norm(object_pos - goal_pos, dim=-1)
    reward = torch.exp(-0.2 * (20.0 * distance + rotation_distance))
    return reward, {"distance": distance, "rotation_distance": rotation_distance}
