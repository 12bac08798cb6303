"""Pendulum: a motor too weak to lift a rod in one go swings it up and holds it there.

A whole task in one file; docs/guides/your-own-task.md walks through it.

eureka train env=examples/pendulum.py reward=human,sparse
eureka run env=examples/pendulum.py model=random
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import torch
from torch import Tensor

from openeureka.tasks.task import Recipe, Score, State, Task, mean_over_steps
from openeureka.types import StateSpec, StateVar

MAX_TORQUE = 2.0  # [N m] at full action; gravity pulls the level rod with 4.9 N m
UPRIGHT = 0.2  # [rad]


class Pendulum(Task):
    env = "pendulum"
    suite = "examples"
    description = "to swing the pendulum up and keep it upright"
    episode_length = 200
    control_dt = 0.05
    substeps = 4
    num_observations = 3
    num_actions = 1

    spec = StateSpec(
        (
            StateVar("obs_buf", "cosine and sine of the angle, rate", (3,)),
            StateVar("angle", "angle from upright [rad], -pi to pi", use="zero_centred"),
            StateVar("angular_velocity", "rate of the angle [rad/s]", use="zero_centred"),
            StateVar("actions", "last action, torque / 2 N m", (1,), use="zero_centred"),
        )
    )
    recipe = Recipe(hidden=(32, 32), env_steps=600_000, epochs=8, reward_scale=0.1)
    human = """
        import torch

        def compute_reward(angle, angular_velocity, actions):
            upright = torch.cos(angle)
            spin = 0.01 * angular_velocity**2
            effort = 0.001 * actions.square().sum(dim=-1)
            return upright - spin - effort, {"upright": upright, "spin": spin, "effort": effort}
    """

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.worldbody.add_light(pos=[0, 0, 4])
        rod = spec.worldbody.add_body(name="rod", pos=[0, 0, 1.5])
        rod.add_joint(name="hinge", axis=[0, 1, 0])
        shape = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "contype": 0, "conaffinity": 0}
        rod.add_geom(fromto=[0, 0, 0, 0, 0, 1], size=[0.03, 0, 0], mass=1, **shape)
        motor = spec.add_actuator(name="torque", target="hinge", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gear[0] = MAX_TORQUE
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))

    def apply_action(self, actions: Tensor) -> None:
        self.ctrl[:] = actions

    def compute_state(self) -> dict[str, Any]:
        turned = self.qpos[:, 0]
        return {
            "angle": torch.atan2(torch.sin(turned), torch.cos(turned)),
            "angular_velocity": self.qvel[:, 0].clone(),
            "actions": self.actions,
        }

    def observe(self, s: State) -> Tensor:
        return torch.stack((torch.cos(s["angle"]), torch.sin(s["angle"]), s["angular_velocity"]), dim=-1)

    def terminated(self, s: State) -> Tensor:
        return torch.zeros_like(s["angle"], dtype=torch.bool)  # only the time-out ends an episode

    def reset(self, worlds: Tensor) -> None:
        self.qpos[worlds] = self.noise.uniform(worlds, 1, -math.pi, math.pi)
        self.qvel[worlds] = self.noise.uniform(worlds, 1, -1.0, 1.0)

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_steps(self.sparse_reward(s))  # F: the share of time spent upright

    def sparse_reward(self, s: State) -> Tensor:
        return (s["angle"].abs() < UPRIGHT).to(torch.float32)
