import torch

REWARDED_POSITION = [0.0, 0.0, 0.7]  # [m]


def compute_reward(ball_positions, ball_linvels):
    distance = (ball_positions - torch.tensor(REWARDED_POSITION)).norm(dim=-1)
    speed = ball_linvels.norm(dim=-1)
    reward = 1.0 / (1.0 + distance) / (1.0 + speed)
    return reward, {"distance": distance, "speed": speed}
