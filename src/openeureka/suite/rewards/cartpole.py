import math

import torch


def compute_reward(cart_position, cart_velocity, pole_angle, pole_velocity):
    tilt = pole_angle**2
    cart_motion = 0.01 * cart_velocity.abs()
    pole_motion = 0.005 * pole_velocity.abs()
    failed = (cart_position.abs() > 3.0) | (pole_angle.abs() > math.pi / 2)
    reward = torch.where(failed, -2.0, 1.0 - tilt - cart_motion - pole_motion)
    return reward, {"tilt": tilt, "cart_motion": cart_motion, "pole_motion": pole_motion}
