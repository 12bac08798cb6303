import torch


def compute_reward(object_pos, object_linvel, goal_pos, fingertip_pos, fingertip_another_pos, left_base_pos):
    """A throw: an arc along the way first, a left hand that waits below the goal, then the catch."""
    distance = torch.norm(goal_pos - object_pos, dim=-1)
    covered = torch.clamp((-0.39 - object_pos[:, 1]) / 0.4, 0.0, 1.2)
    arc = 0.54 + 0.25 * 4.0 * covered * (1.0 - covered)
    aloft = covered * torch.exp(-torch.abs(object_pos[:, 2] - arc) / 0.15)
    right = torch.norm(fingertip_pos - object_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    left = torch.norm(fingertip_another_pos - object_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    released = torch.sigmoid((right - 0.15) / 0.03)
    caught = released * torch.exp(-left / 0.1)
    waiting = torch.exp(-torch.norm(fingertip_another_pos.mean(dim=1) - goal_pos, dim=-1) / 0.15)
    home = caught * torch.exp(-distance / 0.08)
    reward = 2.0 * aloft + 0.3 * waiting + 2.0 * caught + 4.0 * home - 0.1 * torch.abs(left_base_pos[:, 0])
    progress_way = covered
    progress_release = (right - 0.08) / 0.2
    progress_catch = caught
    components = {"aloft": aloft, "waiting": waiting, "caught": caught, "home": home}
    told = {"progress_way": progress_way, "progress_release": progress_release, "progress_catch": progress_catch}
    return reward, {**components, **told}
