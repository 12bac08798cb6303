"""Costs that a policy is measured by while it plays, as far as the model of its task has them."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import torch
from torch import Tensor

from ..errors import ConfigError, nearest
from ..types import COSTS, Limits
from .anatomy import driven_joints, floating_joint, scalar_joints
from .env import BatchedEnv, Step
from .registry import get
from .task import Task

NEAR_END = 0.01
"""Share of a joint's range within which it counts as at an end."""
_TORQUES = ("torque", "torque_peak", "torque_rate", "speed", "power")


class Meter:
    """Measures L lanes of n worlds, each from the start of an episode to its end. Simulates nothing.

    Forces are those of the last substep of each step.

    Args:
        env: stepped by the caller; `Meter` takes its `watch`.
    """

    def __init__(self, env: BatchedEnv) -> None:
        self._env, self._each = env, dict[str, Callable[[], Tensor]]()
        self.names = () if env.task.steps_itself else measured(type(env.task), env.sim.model)
        """Costs that the task has, in the order of `COSTS`."""
        if not self.names:
            return
        model, device = env.sim.model, env.sim.device
        joints = _driven(model)
        dofs = torch.tensor([int(model.jnt_dofadr[joint]) for joint in joints], device=device)
        self._torque = torch.zeros(env.num_worlds, len(joints), device=device)
        """(N, joints) of the last step."""
        if "torque" in self.names:
            force, rate = env.sim.bind("qfrc_actuator"), env.sim.bind("qvel")
            self._each = {
                "torque": lambda: force[:, dofs].abs().amax(1),
                "torque_rate": lambda: self._change(force[:, dofs]) / env.task.control_dt,
                "speed": lambda: rate[:, dofs].abs().amax(1),
                "power": lambda: (force[:, dofs] * rate[:, dofs]).abs().sum(1),
            }
        if "joint_limits" in self.names:
            limited = [joint for joint in joints if model.jnt_limited[joint]]
            places = torch.tensor([int(model.jnt_qposadr[joint]) for joint in limited], device=device)
            ends = torch.tensor(model.jnt_range[limited], dtype=torch.float32, device=device)
            near = NEAR_END * (ends[:, 1] - ends[:, 0])
            at = env.sim.bind("qpos")
            self._each["joint_limits"] = lambda: (
                ((at[:, places] < ends[:, 0] + near) | (at[:, places] > ends[:, 1] - near)).any(1).float()
            )
        if "contact_force" in self.names:
            base = int(model.jnt_dofadr[floating_joint(model)])
            pressed = env.sim.bind("qfrc_constraint")  # for a free joint: all contacts of the bodies on it
            self._each["contact_force"] = lambda: pressed[:, base : base + 3].norm(dim=1)
        zeros = torch.zeros(len(self._each), env.num_worlds, dtype=torch.float64, device=device)
        self._now, self._sum, self._most = zeros, zeros.clone(), zeros.clone()
        self._steps, self._falls = zeros.new_zeros(env.num_worlds), zeros.new_zeros(env.num_worlds)
        env.watch = self._look

    def add(self, step: Step, running: Tensor) -> None:
        """Count the step just simulated, for the worlds (N,) bool that are still `running`."""
        if not self.names:
            return
        now = torch.where(running & ~step.bad, self._now, 0.0)
        self._sum += now
        self._most = torch.maximum(self._most, now)
        self._steps += running
        self._falls += running & step.terminated

    def read(self, lanes: int) -> list[dict[str, float]]:
        """Costs of each lane by name; all finite."""
        if not self.names:
            return [{} for _ in range(lanes)]
        steps = self._steps.view(lanes, -1).sum(1)
        found = {
            name: (total.view(lanes, -1).sum(1) / steps.clamp(min=1.0)).tolist()
            for name, total in zip(self._each, self._sum, strict=True)
        }
        most = dict(zip(self._each, self._most, strict=True)) | {"falls": self._falls}
        for name, series in (("torque_peak", "torque"), ("contact_force", "contact_force"), ("falls", "falls")):
            if name in self.names:
                found[name] = most[series].view(lanes, -1).mean(1).tolist()
        return [{name: found[name][lane] for name in self.names} for lane in range(lanes)]

    def _look(self) -> None:
        """Measure a step before any world is reset."""
        if self._each:  # a robot without drives and contacts has no cost but falls
            self._now = torch.stack([measure() for measure in self._each.values()]).nan_to_num(0.0, 0.0, 0.0).double()

    def _change(self, torque: Tensor) -> Tensor:
        """Largest change of a torque (N,) since the last step; 0 in the first step of an episode."""
        before, self._torque = self._torque, torque.clone()
        first = self._steps == 0
        return (torque - before).abs().amax(1).masked_fill(first, 0.0)


def measured(task: type[Task], model: mujoco.MjModel) -> tuple[str, ...]:
    """Which of `COSTS` a task has, with this model; `falls` only where nothing but failures ends an episode early."""
    joints, found = _driven(model), set[str]()
    if joints:
        found |= set(_TORQUES)
        found |= {"joint_limits"} if any(model.jnt_limited[joint] for joint in joints) else set()
    if floating_joint(model) >= 0:
        found |= {"falls"} if task.counts_early else set()
        touches = (model.geom_contype | model.geom_conaffinity) != 0
        # The forces that hold a closed chain together would count as contact.
        held = np.isin(model.eq_type, (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)).any()
        found |= {"contact_force"} if touches.any() and not held else set()
    return tuple(name for name in COSTS if name in found)


def check(env: str, limits: Limits) -> None:
    """Raises ConfigError for a limit on a cost that the task does not have; it names those that it has."""
    if not limits:
        return
    task = get(env)
    known = () if task.steps_itself else measured(task, task.compile_model())
    for name in limits:
        if name not in known:
            raise ConfigError(
                f"`{task.env}` has no cost `{name}` to limit.{nearest(name, known)} It has "
                f"{', '.join(f'{name} [{COSTS[name].unit}]' for name in known) or 'none'}."
            )


def _driven(model: mujoco.MjModel) -> list[int]:
    """Hinges and slides that an actuator moves."""
    return sorted(set(driven_joints(model)) & set(scalar_joints(model)))
