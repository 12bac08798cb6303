import torch

CONTROL_DT = 0.02  # [s]


def compute_reward(velocity_error, yaw_rate_error, torques):
    linear = torch.exp(-velocity_error.square().sum(dim=-1) / 0.25)
    yaw = 0.5 * torch.exp(-yaw_rate_error.square() / 0.25)
    effort = 2.5e-5 * torques.square().sum(dim=-1)
    reward = CONTROL_DT * (linear + yaw - effort).clamp(min=0.0)
    return reward, {"linear": linear, "yaw": yaw, "effort": effort}
