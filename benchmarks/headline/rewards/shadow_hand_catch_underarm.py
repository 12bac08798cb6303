import torch
from typing import Dict, Tuple


def compute_reward(object_pos: torch.Tensor, object_linvel: torch.Tensor, goal_pos: torch.Tensor,
                   rotation_distance: torch.Tensor, fingertip_another_pos: torch.Tensor,
                   actions: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    wide_scale = 0.15
    fine_scale = 0.03
    held_distance = 0.4
    launch_cos_power_up = 0.7
    w_wide = 2.0
    w_fine = 3.0
    w_launch = 0.7
    w_catch = 0.5
    w_rotation = 0.5
    w_drop = 0.6
    w_action = 0.015

    offset = goal_pos - object_pos
    distance = torch.norm(offset, dim=-1)
    held = 1.0 / (1.0 + (held_distance / wide_scale) ** 2)
    wide = w_wide * (1.0 / (1.0 + torch.square(distance / wide_scale)) - held)
    fine = w_fine / (1.0 + torch.square(distance / fine_scale))

    # 45 degrees upwards along the way to the goal is the cheapest throw
    flat = torch.norm(offset[:, :2], dim=-1)
    aim_flat = offset[:, :2] / (flat.unsqueeze(-1) + 1e-3)
    along = (object_linvel[:, :2] * aim_flat).sum(dim=-1)
    aimed = launch_cos_power_up * along + launch_cos_power_up * torch.clamp(object_linvel[:, 2], -1.0, 2.0)
    far = torch.clamp((flat - 0.2) / 0.15, 0.0, 1.0)
    launch = w_launch * far * torch.where(along > 0.0, torch.clamp(aimed / 2.0, -0.3, 1.0), -0.1 * torch.ones_like(along))

    tips = torch.norm(fingertip_another_pos - object_pos.unsqueeze(1), dim=-1).mean(dim=-1)
    catch = w_catch * (1.0 - far) * torch.exp(-tips / 0.08)
    rotation = w_rotation * torch.exp(-distance / 0.04) * (1.0 - rotation_distance / 3.1416)
    drop = -w_drop * torch.clamp((goal_pos[:, 2] - 0.12 - object_pos[:, 2]) / 0.3, 0.0, 1.0)
    action = -w_action * torch.mean(torch.square(actions), dim=-1)

    reward = wide + fine + launch + catch + rotation + drop + action
    components = {
        "wide": wide, "fine": fine, "launch": launch, "catch": catch,
        "rotation": rotation, "drop": drop, "action": action, "distance": distance,
    }
    return reward, components
