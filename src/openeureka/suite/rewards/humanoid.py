import torch

FALL_HEIGHT = 0.8  # [m]
TRUNK = [67.5, 67.5, 67.5]
LEG = [45.0, 45.0, 135.0, 90.0, 22.5, 22.5]
ARM = [67.5, 67.5, 45.0]


def compute_reward(
    potentials, prev_potentials, torso_height, heading_proj, up_proj, actions, dof_vel, dof_vel_scale, dof_pos_scaled
):
    effort_ratio = torch.tensor(TRUNK + LEG + LEG + ARM + ARM) / 135.0  # of each joint's largest torque [N m]
    speed = potentials - prev_potentials
    posture = (0.5 * heading_proj / 0.8).clamp(max=0.5) + 0.1 * (up_proj > 0.93)
    effort = 0.01 * actions.square().sum(dim=-1)
    energy = 0.05 * ((actions * dof_vel * dof_vel_scale).abs() * effort_ratio).sum(dim=-1)
    beyond = (dof_pos_scaled.abs() - 0.98).clamp(min=0.0) / 0.02
    at_limit = 0.25 * (beyond * effort_ratio).sum(dim=-1)
    reward = speed + 2.0 + posture - effort - energy - at_limit
    reward = torch.where(torso_height < FALL_HEIGHT, -1.0, reward)
    return reward, {"speed": speed, "posture": posture, "effort": effort, "energy": energy, "at_limit": at_limit}
