import torch


def compute_reward(object_pos, object_linvel, goal_pos, actions):
    """The egg's distance at three scales, and rest at the goal."""
    distance = torch.norm(object_pos - goal_pos, dim=-1)
    speed = torch.norm(object_linvel, dim=-1)
    far = torch.exp(-distance / 0.25)
    near = torch.exp(-distance / 0.06)
    rest = near * torch.exp(-speed / 0.5)
    dropped = torch.relu(0.45 - object_pos[:, 2]) / 0.25
    effort = torch.mean(actions**2, dim=-1)
    reward = far + 2.0 * near + 4.0 * rest - 0.5 * dropped - 0.01 * effort
    progress_way = 1.0 - distance / 0.25
    progress_flight = (object_pos[:, 2] - 0.54) / 0.2
    components = {"far": far, "near": near, "rest": rest, "dropped": dropped, "effort": effort}
    return reward, {**components, "progress_way": progress_way, "progress_flight": progress_flight}
