def compute_reward(target_position, root_positions, up_proj, root_angvels):
    distance = (target_position - root_positions).norm(dim=-1)
    near = 1.0 / (1.0 + distance**2)
    level = 1.0 / (1.0 + (1.0 - up_proj) ** 2)
    still = 1.0 / (1.0 + root_angvels[:, 2] ** 2)
    reward = near * (1.0 + level + still)
    return reward, {"near": near, "level": level, "still": still}
