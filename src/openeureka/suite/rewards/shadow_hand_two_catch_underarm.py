import torch


def closeness(thing_pos, goal_pos, rotation_distance):
    distance = torch.linalg.vector_norm(thing_pos - goal_pos, dim=-1)
    return torch.exp(-0.2 * (50.0 * distance + rotation_distance))


def compute_reward(
    object_pos, goal_pos, rotation_distance, object_another_pos, goal_another_pos, rotation_distance_another
):
    first = closeness(object_pos, goal_pos, rotation_distance)
    second = closeness(object_another_pos, goal_another_pos, rotation_distance_another)
    return first + second, {"first": first, "second": second}
