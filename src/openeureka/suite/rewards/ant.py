import torch

FALL_HEIGHT = 0.31  # [m]


def compute_reward(
    potentials, prev_potentials, torso_height, heading_proj, up_proj, actions, dof_vel, dof_vel_scale, dof_pos_scaled
):
    speed = potentials - prev_potentials
    posture = (0.5 * heading_proj / 0.8).clamp(max=0.5) + 0.1 * (up_proj > 0.93)
    effort = 0.005 * actions.square().sum(dim=-1)
    energy = 0.05 * (actions * dof_vel * dof_vel_scale).abs().sum(dim=-1)
    at_limit = 0.1 * (dof_pos_scaled > 0.99).sum(dim=-1)
    reward = speed + 0.5 + posture - effort - energy - at_limit
    reward = torch.where(torso_height < FALL_HEIGHT, -2.0, reward)
    return reward, {"speed": speed, "posture": posture, "effort": effort, "energy": energy, "at_limit": at_limit}
