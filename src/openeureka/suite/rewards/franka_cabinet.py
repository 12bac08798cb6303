import torch

OPENED = 0.39  # [m]


def compute_reward(
    drawer_grasp_pos,
    franka_grasp_pos,
    franka_lfinger_pos,
    franka_rfinger_pos,
    left_finger_above_handle,
    right_finger_below_handle,
    gripper_forward_proj,
    gripper_up_proj,
    drawer_opening,
    actions,
):
    distance = (drawer_grasp_pos - franka_grasp_pos).norm(dim=-1)
    around = (left_finger_above_handle > 0) & (right_finger_below_handle > 0)
    grasped = 0.5 * around

    near = (1.0 / (1.0 + distance.square())).square() * torch.where(distance <= 0.02, 2.0, 1.0)
    forward = 0.5 * gripper_forward_proj.sign() * gripper_forward_proj.square()
    turned = forward + 0.5 * gripper_up_proj.sign() * gripper_up_proj.square()
    gap = 0.08 - left_finger_above_handle.abs() - right_finger_below_handle.abs()
    closed = torch.where(around, gap, 0.0)
    opened = drawer_opening * grasped + drawer_opening
    effort = actions.square().sum(dim=-1)
    first, second, third = drawer_opening > 0.01, drawer_opening > 0.2, drawer_opening > OPENED
    bonus = 0.5 * first + grasped * second + 2.0 * grasped * third
    reward = 2.0 * near + 0.5 * turned + 0.25 * grasped + 7.5 * opened + 5.0 * closed - 0.01 * effort + bonus

    furthest = torch.minimum(franka_lfinger_pos[:, 0], franka_rfinger_pos[:, 0])
    reward = torch.where(furthest < drawer_grasp_pos[:, 0] - 0.04, -1.0, reward)
    return reward, {
        "near": near,
        "turned": turned,
        "grasped": grasped,
        "opened": opened,
        "closed": closed,
        "effort": effort,
        "bonus": bonus,
    }
