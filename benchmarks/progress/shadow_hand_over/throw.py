import torch


def compute_reward(object_pos, object_linvel, goal_pos, fingertip_another_pos):
    """Speed towards the goal while the egg is on its way, then closed fingers of the left hand around it."""
    way = goal_pos - object_pos
    distance = torch.norm(way, dim=-1)
    heading = way / (distance + 0.01).unsqueeze(-1)
    approach = torch.clamp(torch.sum(object_linvel * heading, dim=-1), -1.0, 1.5) * torch.tanh(distance / 0.05)
    high = (object_pos[:, 2] > 0.48).float()
    there = torch.exp(-((distance / 0.08) ** 2))
    held = there * torch.exp(-torch.norm(fingertip_another_pos - object_pos.unsqueeze(1), dim=-1).mean(dim=-1) / 0.08)
    reward = approach * high + 2.0 * there + 3.0 * held
    progress_way = (-0.39 - object_pos[:, 1]) / 0.25
    progress_held = there * torch.exp(-torch.norm(object_linvel, dim=-1) / 0.5)
    components = {"approach": approach, "there": there, "held": held}
    return reward, {**components, "progress_way": progress_way, "progress_held": progress_held}
