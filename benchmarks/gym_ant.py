"""Gymnasium's Ant-v5 as a task of this project: its own `ant.xml`, integrator, frame skip, observation and reward.

Only a benchmark: both sides of a comparison must step the same physics.
"""

from __future__ import annotations

import math
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import torch
from torch import Tensor

from openeureka.tasks.task import Recipe, Score, State, Task, mean_over_steps
from openeureka.types import StateSpec, StateVar

FRAME_SKIP = 5
HEALTHY_HEIGHT = (0.2, 1.0)  # [m]
RESET_NOISE = 0.1


class GymAnt(Task):
    env = "gym_ant"
    suite = "gymnasium"
    description = "to make the ant run forward as fast as possible"
    episode_length = 1001  # a time-out is raised at step 1000, like Gymnasium's TimeLimit
    control_dt = 0.05
    substeps = FRAME_SKIP
    num_observations = 105
    num_actions = 8
    memory = ("x",)

    spec = StateSpec(
        (
            StateVar(name="obs_buf", shape=(105,), meaning="pose without x and y, velocities, clipped contact forces"),
            StateVar(name="velocity", meaning="forward velocity over the last step [m/s]", use="directional"),
            StateVar(name="height", meaning="height of the torso [m]"),
            StateVar(name="contact_forces", shape=(14, 6), meaning="contact wrench of each body, clipped to +-1"),
            StateVar(name="actions", shape=(8,), meaning="last action"),
        )
    )
    recipe = Recipe(hidden=(64, 64), env_steps=1_000_000, worlds=64, horizon=16, epochs=4, minibatches=2)

    @staticmethod
    def model() -> mujoco.MjSpec:
        package = find_spec("gymnasium")
        if package is None or package.origin is None:
            raise SystemExit("Install the extra `bench` for this benchmark: pip install -e '.[bench]'.")
        spec = mujoco.MjSpec.from_file(str(Path(package.origin).parent / "envs/mujoco/assets/ant.xml"))
        # Contact wrenches are only computed for a model with a force sensor; Gymnasium asks for them after every step.
        spec.body("torso").add_site(name="torso")
        spec.add_sensor(
            name="force", type=mujoco.mjtSensor.mjSENS_FORCE, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="torso"
        )
        return spec

    @classmethod
    def compile_model(cls) -> mujoco.MjModel:
        """The file's own timestep (0.01 s) and integrator (RK4), unlike this project's tasks."""
        return cls.model().compile()

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl, self.cfrc_ext = (
            self.sim.bind(field) for field in ("qpos", "qvel", "ctrl", "cfrc_ext")
        )
        self.x = self.qpos[:, 0].clone()

    def apply_action(self, actions: Tensor) -> None:
        self.x.copy_(self.qpos[:, 0])
        self.ctrl[:] = actions

    def compute_state(self) -> dict[str, Any]:
        return {
            "velocity": (self.qpos[:, 0] - self.x) / self.control_dt,
            "height": self.qpos[:, 2].clone(),
            "contact_forces": self.cfrc_ext.clamp(-1.0, 1.0),
            "actions": self.actions,
        }

    def observe(self, s: State) -> Tensor:
        return torch.cat((self.qpos[:, 2:], self.qvel, s["contact_forces"][:, 1:].flatten(1)), dim=1)

    def terminated(self, s: State) -> Tensor:
        low, high = HEALTHY_HEIGHT
        return (s["height"] < low) | (s["height"] > high)

    def reset(self, worlds: Tensor) -> None:
        start = torch.from_numpy(self.sim.model.qpos0).float()
        noise = self.noise.uniform(worlds, len(start), -RESET_NOISE, RESET_NOISE)
        self.qpos[worlds] = start + noise
        uniform = self.noise.uniform(worlds, self.qvel.shape[1], -1.0 + 1e-6, 1.0 - 1e-6)
        self.qvel[worlds] = RESET_NOISE * math.sqrt(2.0) * torch.erfinv(uniform)  # normal
        self.x[worlds] = self.qpos[worlds, 0]

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_steps(s["velocity"])

    def human_reward(self, s: State) -> Tensor:
        healthy = (~self.terminated(s)).float()
        control = 0.5 * (s["actions"] ** 2).sum(1)
        contact = 5e-4 * (s["contact_forces"] ** 2).sum((1, 2))
        return s["velocity"] + healthy - control - contact

    def sparse_reward(self, s: State) -> Tensor:
        return s["velocity"]
