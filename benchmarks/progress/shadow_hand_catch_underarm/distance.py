import torch


def compute_reward(object_pos, object_linvel, goal_pos, actions):
    """The egg's distance at three scales, and rest at the goal."""
    distance = torch.norm(object_pos - goal_pos, dim=-1)
    speed = torch.norm(object_linvel, dim=-1)
    far = 1.0 - torch.clamp(distance / 0.6, 0.0, 1.0)
    near = torch.exp(-distance / 0.1)
    rest = near * torch.exp(-speed / 0.5)
    effort = torch.mean(actions**2, dim=-1)
    reward = far + 2.0 * near + 4.0 * rest - 0.02 * effort
    progress_way = 1.0 - distance / 0.4
    progress_flight = (object_pos[:, 2] - 0.5) / 0.3
    progress_rest = rest
    components = {"far": far, "near": near, "rest": rest, "effort": effort}
    told = {"progress_way": progress_way, "progress_flight": progress_flight, "progress_rest": progress_rest}
    return reward, {**components, **told}
