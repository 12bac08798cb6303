"""Honest reward programs in the styles that language models and people write, and the state tables they read."""

from __future__ import annotations

from typing import Any

import torch

from openeureka.types import StateSpec, StateVar


def _world(name: str, *shape: int) -> StateVar:
    return StateVar(name=name, meaning=name, shape=shape)


def _number(name: str, kind: str = "float") -> StateVar:
    return StateVar(name=name, meaning=name, kind=kind)  # type: ignore[arg-type]


CARTPOLE = StateSpec(
    (_world("obs_buf", 4), _world("dof_pos", 2), _world("dof_vel", 2), _number("num_envs", "num_envs"))
)
ANT = StateSpec(
    (
        _world("root_states", 13),
        _world("targets", 3),
        _world("potentials"),
        _world("prev_potentials"),
        _world("up_vec", 3),
        _world("heading_vec", 3),
        _world("dof_pos", 8),
        _world("dof_vel", 8),
        StateVar(name="dof_limits_lower", meaning="", shape=(8,), kind="constant"),
        StateVar(name="dof_limits_upper", meaning="", shape=(8,), kind="constant"),
        _world("actions", 8),
        _world("inv_start_rot", 4),
        _world("basis_vec0", 3),
        _world("basis_vec1", 3),
        _number("dt"),
        _number("up_axis_idx", "int"),
        _number("num_envs", "num_envs"),
    )
)
HAND = StateSpec(
    (
        _world("object_pos", 3),
        _world("object_rot", 4),
        _world("object_linvel", 3),
        _world("object_angvel", 3),
        _world("goal_pos", 3),
        _world("goal_rot", 4),
        _world("fingertip_pos", 5, 3),
        _world("shadow_hand_dof_pos", 24),
        _world("shadow_hand_dof_vel", 24),
        _world("actions", 20),
        _number("vel_obs_scale"),
        _number("num_fingertips", "int"),
    )
)
NUMBERS = {"dt": 0.0166, "up_axis_idx": 2, "vel_obs_scale": 0.2, "num_fingertips": 5}


def recorded(spec: StateSpec, worlds: int = 256, seed: int = 0) -> dict[str, torch.Tensor | float | int]:
    """States with unit quaternions, ordered limits, and a few worlds at rest as after a reset."""
    generator = torch.Generator().manual_seed(seed)
    states: dict[str, torch.Tensor | float | int] = {}
    for variable in spec.variables:
        if variable.kind in ("float", "int"):
            states[variable.name] = NUMBERS[variable.name]
        elif variable.kind == "constant":
            sign = -1.0 if "lower" in variable.name else 1.0
            states[variable.name] = sign * (0.5 + torch.rand(variable.shape, generator=generator))
        elif variable.kind == "world":
            value = torch.randn((worlds, *variable.shape), generator=generator)
            if not variable.name.endswith("rot"):
                value[:4] = 0.0
            if variable.name.endswith("rot"):
                value = torch.nn.functional.normalize(value, dim=-1)
            if variable.name == "root_states":
                value[:, 3:7] = torch.nn.functional.normalize(value[:, 3:7] + torch.tensor([0.0, 0, 0, 1e-3]), dim=-1)
            states[variable.name] = value
    return states


PROGRAMS: dict[str, tuple[StateSpec, str]] = {}


def _add(name: str, spec: StateSpec, source: str) -> None:
    PROGRAMS[name] = (spec, source)


_add(
    "torchscript with typed tuple and dict",
    CARTPOLE,
    '''
import torch
from torch import Tensor
from typing import Dict, Tuple

@torch.jit.script
def compute_reward(dof_pos: torch.Tensor, dof_vel: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    """Keep the pole upright."""
    pole_angle = dof_pos[:, 1]
    cart_pos = dof_pos[:, 0]
    angle_temp: float = 0.5
    angle_reward = torch.exp(-torch.abs(pole_angle) / angle_temp)
    cart_penalty = 0.1 * cart_pos ** 2
    total_reward = angle_reward - cart_penalty
    return total_reward, {"angle_reward": angle_reward, "cart_penalty": cart_penalty}
''',
)
_add(
    "where on whole tensors as the original human reward",
    CARTPOLE,
    """
@torch.jit.script
def compute_cartpole_reward(dof_pos, dof_vel):
    # type: (Tensor, Tensor) -> Tuple[Tensor, Dict[str, Tensor]]
    pole_angle, cart_pos = dof_pos[:, 1], dof_pos[:, 0]
    reward = 1.0 - pole_angle * pole_angle - 0.01 * torch.abs(dof_vel[:, 0]) - 0.005 * torch.abs(dof_vel[:, 1])
    reward = torch.where(torch.abs(cart_pos) > 3.0, torch.ones_like(reward) * -2.0, reward)
    reward = torch.where(torch.abs(pole_angle) > 3.14159 / 2, torch.ones_like(reward) * -2.0, reward)
    return reward, {"reward": reward}
""",
)
_add(
    "masked in-place edits of a fresh tensor",
    CARTPOLE,
    """
import torch
import math
def compute_reward(dof_pos, dof_vel, num_envs):
    reward = torch.zeros(num_envs, device=dof_pos.device, dtype=torch.float32)
    upright = torch.abs(dof_pos[:, 1]) < math.pi / 12
    reward[upright] = 1.0
    reward[upright] += torch.cos(dof_pos[:, 1][upright])
    reward -= 0.01 * dof_vel[:, 1] ** 2
    reward.clamp_(-1.0, 2.0)
    reward[:] = reward * 0.5
    return reward, {"upright": upright}
""",
)
_add(
    "method form with self",
    CARTPOLE,
    """
def compute_reward(self):
    cart, pole = self.dof_pos.unbind(dim=-1)
    alive = torch.ones(self.num_envs, device=self.device)
    dof_pos = self.dof_pos.clone()
    dof_pos += 1.0
    closeness = self._closeness(pole, 0.3)
    return alive + closeness - 0.05 * cart.abs() + 0.0 * dof_pos[:, 0], dict(closeness=closeness, alive=alive)

def _closeness(self, x, temperature):
    return torch.exp(-x.square() / temperature) * (1.0 + 0.0 * self.dof_vel[:, 0])
""",
)
_add(
    "Python floats as components",
    CARTPOLE,
    """
from typing import Dict, Tuple
import torch
def compute_reward(obs_buf: torch.Tensor) -> Tuple[torch.Tensor, Dict[str, float]]:
    scale: float = 2.0
    r = scale * torch.cos(obs_buf[:, 2])
    return r, {"scale": scale, "bonus": 1}
""",
)
_add(
    "state variables left out of the signature",
    CARTPOLE,
    """
def compute_reward(dof_pos):
    speed = torch.tanh(dof_vel[:, 0].abs())
    return -speed - dof_pos[:, 1].abs(), {"speed": -speed}
""",
)
_add(
    "module constants, helper with a default, print and assert",
    CARTPOLE,
    """
import torch
ANGLE_WEIGHT = 2.0
WEIGHTS = (1.0, 0.1)

def tolerance(x: torch.Tensor, margin: float = 0.25) -> torch.Tensor:
    return 1.0 / (1.0 + (x / margin) ** 2)

def compute_reward(dof_pos, dof_vel):
    assert dof_pos.shape[1] == 2
    print("shape", dof_pos.shape)
    angle = ANGLE_WEIGHT * tolerance(dof_pos[:, 1])
    slow = WEIGHTS[1] * tolerance(dof_vel[:, 1], margin=2.0)
    return angle + slow, {"angle": angle, "slow": slow}
""",
)
_add(
    "branches on shapes and constants",
    CARTPOLE,
    """
def compute_reward(dof_pos, dof_vel):
    use_velocity = True
    total = -dof_pos[:, 1].abs()
    if use_velocity and dof_vel.dim() == 2:
        total = total - 0.1 * dof_vel[:, 1].abs()
    total = total if dof_pos.shape[-1] > 1 else -total
    return total, {}
""",
)
_add(
    "sum over a dict of weighted terms",
    CARTPOLE,
    """
def compute_reward(dof_pos, dof_vel):
    terms = {"angle": torch.exp(-10 * dof_pos[:, 1].pow(2)), "rate": -dof_vel[:, 1].pow(2)}
    weights = {"angle": 1.0, "rate": 0.01}
    total = sum(weights[name] * term for name, term in terms.items())
    return total, {f"{name}_term": weights[name] * term for name, term in terms.items()}
""",
)
_add(
    "heading and up of the ant with the field's helpers",
    ANT,
    """
import torch
from isaacgymenvs.utils.torch_jit_utils import *
@torch.jit.script
def compute_gpt_reward(root_states: torch.Tensor, targets: torch.Tensor, inv_start_rot: torch.Tensor,
                       basis_vec0: torch.Tensor, basis_vec1: torch.Tensor, up_axis_idx: int):
    torso_position = root_states[:, 0:3]
    torso_rotation = root_states[:, 3:7]
    velocity = root_states[:, 7:10]
    to_target = targets - torso_position
    to_target[:, 2] = 0.0
    torso_quat, up_proj, heading_proj, up_vec, heading_vec = compute_heading_and_up(
        torso_rotation, inv_start_rot, to_target, basis_vec0, basis_vec1, up_axis_idx)
    vel_loc, angvel_loc, roll, pitch, yaw, angle_to_target = compute_rot(
        torso_quat, velocity, root_states[:, 10:13], targets, torso_position)
    heading_reward = torch.where(heading_proj > 0.8, torch.ones_like(heading_proj) * 0.5, 0.5 * heading_proj / 0.8)
    up_reward = torch.where(up_proj > 0.93, 0.1, 0.0)
    total = vel_loc[:, 0] + heading_reward + up_reward - 0.01 * normalize_angle(roll).abs()
    return total, {"speed": vel_loc[:, 0], "heading": heading_reward, "up": up_reward}
""",
)
_add(
    "progress, actions and joint limits",
    ANT,
    """
import torch
from typing import Tuple, Dict
@torch.jit.script
def compute_reward(potentials: torch.Tensor, prev_potentials: torch.Tensor, actions: torch.Tensor,
                   dof_pos: torch.Tensor, dof_vel: torch.Tensor, dof_limits_lower: torch.Tensor,
                   dof_limits_upper: torch.Tensor, dt: float) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:
    progress = potentials - prev_potentials
    scaled = unscale(dof_pos, dof_limits_lower, dof_limits_upper)
    at_limit = torch.sum(scaled.abs() > 0.99, dim=-1)
    electricity = torch.sum(torch.abs(actions * dof_vel), dim=-1)
    total = progress - 0.005 * torch.sum(actions ** 2, dim=-1) - 0.05 * electricity * dt - 0.1 * at_limit
    return total, {"progress": progress, "at_limit": at_limit, "electricity": -electricity}
""",
)
_add(
    "forward speed, temperature variables, clamps",
    ANT,
    """
def compute_reward(root_states, up_vec, actions):
    velocity_temperature = 0.5
    forward_velocity = root_states[:, 7]
    velocity_reward = torch.exp(torch.clamp(forward_velocity, min=-2.0, max=4.0) * velocity_temperature) - 1.0
    upright = torch.clip(up_vec[:, 2], 0.0, 1.0)
    effort = -0.05 * torch.mean(actions.square(), dim=1)
    fallen = root_states[:, 2] < 0.31
    total = torch.where(fallen, torch.full_like(velocity_reward, -2.0), velocity_reward + upright + effort)
    return total, {"velocity_reward": velocity_reward, "upright": upright, "effort": effort}
""",
)
_add(
    "loops over joints and stacking",
    ANT,
    """
def compute_reward(dof_pos, dof_vel, num_envs):
    cost = torch.zeros_like(dof_pos[:, 0])
    for joint in range(dof_pos.shape[1]):
        cost = cost + dof_pos[:, joint] ** 2
    parts = [dof_vel[:, i] for i in range(4)]
    symmetric = torch.stack(parts, dim=-1).std(dim=-1, unbiased=False)
    front, back = torch.split(dof_vel, 4, dim=1)
    gait = torch.cosine_similarity(front, back, dim=-1)
    return -0.1 * cost - symmetric + gait, {"cost": cost, "gait": gait}
""",
)
_add(
    "values and indices of a reduction",
    ANT,
    """
def compute_reward(dof_vel, dof_pos):
    fastest = torch.max(torch.abs(dof_vel), dim=-1).values
    slowest, where = torch.min(torch.abs(dof_vel), dim=-1)
    ordered = torch.sort(dof_pos, dim=1)[0]
    best = dof_vel.topk(2, dim=-1).values.sum(-1)
    return slowest - fastest + ordered[:, 0] + 0.1 * best, {"fastest": fastest, "where": where}
""",
)
_add(
    "functional namespace and linalg",
    ANT,
    """
import torch
import torch.nn.functional as F
def compute_reward(root_states, targets, up_vec):
    to_target = F.normalize(targets - root_states[:, :3], dim=-1)
    speed = torch.einsum("ij,ij->i", to_target, root_states[:, 7:10])
    up = F.softplus(up_vec[:, 2]) + F.mse_loss(up_vec, root_states[:, :3], reduction="none").mean(dim=-1)
    spin = torch.linalg.norm(root_states[:, 10:13], dim=-1)
    return speed + up - 0.1 * spin, {"speed": speed, "up": up, "spin": spin}
""",
)
_add(
    "Euler angles",
    ANT,
    """
from isaacgym.torch_utils import get_euler_xyz, quat_rotate_inverse
def compute_reward(root_states):
    roll, pitch, yaw = get_euler_xyz(root_states[:, 3:7])
    roll = torch.where(roll > np_pi, roll - 2 * np_pi, roll)
    local = quat_rotate_inverse(root_states[:, 3:7], root_states[:, 7:10])
    level = torch.exp(-(roll.abs() + normalize_angle(pitch).abs()))
    return local[:, 0] + level, {"level": level}
np_pi = 3.141592653589793
""",
)
_add(
    "keepdim, squeeze and broadcasting against constants",
    ANT,
    """
def compute_reward(dof_pos, dof_limits_lower, dof_limits_upper, root_states):
    middle = 0.5 * (dof_limits_upper + dof_limits_lower)
    distance = torch.norm(dof_pos - middle, p=2, dim=-1, keepdim=True)
    height = root_states[:, 2:3]
    reward = (height - distance).squeeze()
    weights = torch.tensor([1.0, 0.5, 0.25], device=root_states.device)
    return reward + (root_states[:, 7:10] * weights).sum(dim=1), {"distance": distance.squeeze(-1)}
""",
)
_add(
    "the original shape of a hand reward",
    HAND,
    """
@torch.jit.script
def compute_hand_reward(object_pos, goal_pos, object_rot, goal_rot, actions, vel_obs_scale: float):
    goal_dist = torch.norm(object_pos - goal_pos, p=2, dim=-1)
    quat_diff = quat_mul(object_rot, quat_conjugate(goal_rot))
    rot_dist = 2.0 * torch.asin(torch.clamp(torch.norm(quat_diff[:, 0:3], p=2, dim=-1), max=1.0))
    dist_rew = goal_dist * -10.0
    rot_rew = 1.0 / (torch.abs(rot_dist) + 0.1) * 1.0
    action_penalty = torch.sum(actions ** 2, dim=-1)
    reward = dist_rew + rot_rew + action_penalty * -0.0002
    goal_resets = torch.where(torch.abs(rot_dist) <= 0.1, torch.ones_like(reward), torch.zeros_like(reward))
    reward = torch.where(goal_resets == 1, reward + 250.0, reward)
    reward = torch.where(goal_dist >= 0.24, reward + 0.0, reward)
    return reward, {"dist_rew": dist_rew, "rot_rew": rot_rew, "action_penalty": action_penalty}
""",
)
_add(
    "fingertips in a loop",
    HAND,
    """
from typing import Dict, Tuple
import torch
from torch import Tensor
def compute_reward(object_pos: Tensor, fingertip_pos: Tensor, num_fingertips: int) -> Tuple[Tensor, Dict[str, Tensor]]:
    finger_dist = torch.zeros(object_pos.shape[0], dtype=torch.float32, device=object_pos.device)
    for i in range(num_fingertips):
        finger_dist += torch.norm(fingertip_pos[:, i, :] - object_pos, dim=-1)
    all_at_once = (fingertip_pos - object_pos.unsqueeze(1)).norm(dim=-1).sum(dim=-1)
    reach = torch.exp(-finger_dist / (5 * 0.1)) + 1 / (1 + all_at_once)
    return reach, {"finger_dist": -finger_dist}
""",
)
_add(
    "quaternion helpers of every kind",
    HAND,
    """
def compute_reward(object_rot, goal_rot, object_angvel):
    unit = quat_unit(object_rot)
    angle = quat_diff_rad(unit, goal_rot)
    up = quat_axis(unit, 2)[:, 2]
    forward = get_basis_vector(unit, to_torch([1.0, 0.0, 0.0]).repeat(object_rot.shape[0], 1))
    turned = quat_apply(unit, object_angvel)
    angle_b, axis = quat_to_angle_axis(unit)
    rolled = quat_from_euler_xyz(*get_euler_xyz(unit))
    spin = quat_from_angle_axis(angle_b, axis)
    total = torch.exp(-angle) + 0.1 * up + forward[:, 0] + turned[:, 0] + 0.0 * (rolled.sum(-1) + spin.sum(-1))
    return total, {"angle": angle, "up": up}
""",
)
_add(
    "logical masks and casts",
    HAND,
    """
def compute_reward(object_pos, goal_pos, object_linvel):
    near = torch.norm(object_pos - goal_pos, dim=-1) < 1.5
    slow = torch.norm(object_linvel, dim=-1) < 1.5
    success = torch.logical_and(near, slow)
    held = (near & ~slow) | (object_pos[:, 2] > 0.2)
    bonus = success.float() * 10.0 + held.to(torch.float32) + near.int() - slow.long()
    return bonus, {"success": success, "held": held, "bonus": bonus.double()}
""",
)
_add(
    "lambda, comprehension and max of tensors",
    HAND,
    """
def compute_reward(fingertip_pos, object_pos):
    closeness = lambda x, t: torch.exp(-x / t)
    distances = [torch.norm(fingertip_pos[:, i] - object_pos, dim=-1) for i in range(5)]
    nearest = distances[0]
    for distance in distances[1:]:
        nearest = torch.minimum(nearest, distance)
    farthest = torch.max(torch.cat([d.unsqueeze(-1) for d in distances], dim=-1), dim=-1)[0]
    return closeness(nearest, 0.2) + closeness(farthest, 1.0), {"nearest": nearest, "farthest": farthest}
""",
)
_add(
    "device strings, cuda calls and no_grad",
    HAND,
    """
import torch
def compute_reward(object_pos, goal_pos):
    with torch.no_grad():
        offset = torch.tensor([0.0, 0.0, 0.05], device="cuda:0")
        distance = torch.norm(object_pos.to("cuda:0") - goal_pos.cuda() - offset, dim=-1)
    return 1.0 - torch.tanh(5.0 * distance), {"distance": distance}
""",
)
_add(
    "components with unusual names",
    HAND,
    """
def compute_reward(object_pos, goal_pos):
    distance = (object_pos - goal_pos).norm(dim=-1)
    return -distance, {"distance (m)": -distance, "Total Reward": -distance}
""",
)
_add(
    "in-place edit of a rebound name",
    HAND,
    """
def compute_reward(object_pos, goal_pos):
    object_pos = object_pos - goal_pos
    object_pos[:, 2] *= 2.0
    object_pos *= 0.5
    height = object_pos[:, 2].clone()
    height[height < 0] = 0.0
    return height - object_pos.norm(dim=-1), {"height": height}
""",
)
_add(
    "batch mean as a record",
    HAND,
    """
def compute_reward(object_pos, goal_pos):
    distance = (object_pos - goal_pos).norm(dim=-1)
    return -distance, {"mean_distance": distance.mean(), "constant": torch.tensor(0.5)}
""",
)

_add(
    "products with a row of weights",
    ANT,
    """
def compute_reward(dof_pos, dof_vel):
    weights = torch.tensor([1.0, 0.5])
    return weights @ dof_pos[:, :2].T + dof_vel @ torch.ones(8), {"first": dof_pos[:, 0]}
""",
)

_add(
    "numbers of numpy, arithmetic outside the function and in a default",
    ANT,
    """
import numpy as np
import math
LEAN_LIMIT = 12 * 2 * np.pi / 360
WEIGHTS = {"speed": 1.0 / 3.0, "lean": -math.sqrt(2.0)}
def compute_reward(root_states, up_vec, limit: float = np.deg2rad(30.0), half: float = 1 / 2):
    lean = torch.acos(torch.clamp(up_vec[:, 2], -1.0, 1.0))
    over = (lean > LEAN_LIMIT).float() + (lean > limit).float() + half * torch.cos(np.pi * lean) / np.sqrt(2.0)
    return WEIGHTS["speed"] * root_states[:, 7] + WEIGHTS["lean"] * over, {"over": over}
""",
)
_add(
    "imports inside the function and typed containers of TorchScript",
    ANT,
    """
import torch
@torch.jit.unused
def compute_reward(dof_pos, dof_vel):
    import math
    from typing import Dict, List
    from torch import Tensor
    parts = torch.jit.annotate(List[Tensor], [])
    named: Dict[str, Tensor] = torch.jit.annotate(Dict[str, Tensor], {})
    for joint in range(3):
        parts.append(torch.exp(-math.pi * dof_pos[:, joint].abs()))
    named["posture"] = torch.stack(parts, dim=-1).sum(dim=-1)
    spare = dof_vel[:, 0]
    del spare
    return named["posture"], named
""",
)
_add(
    "numbers read out of constants",
    ANT,
    """
def compute_reward(root_states):
    temperature = torch.tensor(0.5)
    fall = torch.tensor([-2.0, 0.0])
    speed = torch.clamp(root_states[:, 7], 0.0, torch.tensor(3.0)) / float(temperature)
    paid = speed if temperature > 0.1 else -speed
    fallen = torch.full_like(paid, fall.min())
    weights = torch.tensor([torch.tensor(1.0), temperature])
    sideways = (root_states[:, 8:10] * weights).sum(dim=-1)
    return torch.where(root_states[:, 2] < 0.3, fallen, paid - sideways.abs()), {"paid": paid}
""",
)
_add(
    "memory that is filled later",
    ANT,
    """
def compute_reward(dof_pos, root_states):
    cost = torch.empty_like(dof_pos)
    for joint in reversed(range(dof_pos.shape[1])):
        cost[:, joint] = dof_pos[:, joint] ** 2
    reward = torch.empty(root_states.shape[0], device=root_states.device)
    reward[:] = root_states[:, 7]
    weight = 0.1 if any([True, False]) else 0.0
    return reward - weight * cost.sum(dim=-1), {"cost": sum(map(torch.abs, cost.unbind(-1)))}
""",
)
_add(
    "functions that few programs use",
    ANT,
    """
import torch.nn.functional as F
def compute_reward(dof_pos, dof_vel):
    spread, middle = torch.std_mean(dof_pos, dim=-1)
    low, high = torch.aminmax(dof_vel, dim=-1)
    second = torch.kthvalue(dof_pos, 2, dim=-1).values + torch.cummax(dof_vel, dim=-1)[0][:, -1]
    near = torch.logit(torch.sigmoid(middle), eps=1e-6) + torch.erfc(middle) + F.mish(high)
    both = torch.bitwise_and(dof_pos > 0, dof_vel > 0)
    power = torch.diagonal(dof_pos.unsqueeze(-1) * dof_vel.unsqueeze(-2), dim1=-2, dim2=-1).sum(-1)
    fixed = torch.tensordot(dof_pos, torch.ones(8), dims=1) + torch.inner(dof_vel, torch.ones(8))
    blocks = torch.moveaxis(dof_pos.view(-1, 4, 2), 1, 2).reshape(-1, 8)[:, 1] + torch.count_nonzero(both, dim=-1)
    tiny = torch.finfo(torch.float32).eps
    return spread - low + second + near + power / (1.0 + tiny) + fixed + blocks, {"power": power}
""",
)
_add(
    "masks that are changed in place, under two names and in part",
    HAND,
    """
def compute_reward(object_pos, goal_pos, object_linvel):
    distance = (object_pos - goal_pos).norm(dim=-1)
    near = distance < 2.0
    held = near
    near &= object_linvel.norm(dim=-1) < 1.5
    near |= object_pos[:, 2] > 0.2
    near ^= goal_pos[:, 2] > 0.5
    both = torch.stack((near, distance < 1.0), dim=-1)
    both[:, 1] &= ~near
    both[distance > 1.5] |= True
    number = both.sum(dim=-1)
    number &= 1
    parts = {"held": held}
    parts |= {"number": number}
    return held.float() + 2.0 * both[:, 0] + 4.0 * both[:, 1] + 8.0 * number - distance, parts
""",
)
_add(
    "constants on one line, infinity, and a cast for the reader",
    HAND,
    """
import typing
from typing import cast
import torch
NEAR, FAR = 0.1, -float("-inf")
LEAST = SMALL = 0.01
def compute_reward(object_pos, goal_pos, most: float = float("inf")):
    distance = (object_pos - goal_pos).norm(dim=-1)
    kept = cast(torch.Tensor, distance.clamp(LEAST, most))
    close = typing.cast("torch.Tensor", kept < NEAR)
    return -torch.where(distance < FAR, kept, distance) + close.float() + SMALL, {"close": close}
""",
)


def sliced(states: dict[str, Any]) -> dict[str, Any]:
    """The same states as non-contiguous slices of larger tensors, which a task's states may be."""
    return {
        name: torch.stack((value, value), dim=-1)[..., 0] if isinstance(value, torch.Tensor) and value.dim() else value
        for name, value in states.items()
    }
