"""Cartpole: a force on a cart keeps the pole above it upright."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import torch
from torch import Tensor

from ...tasks.task import Recipe, Score, State, Task, View, mean_over_episodes
from ...types import StateSpec, StateVar
from ..assets import REWARDS

MAX_FORCE = 400.0  # [N] at full action
MAX_POSITION = 3.0  # [m]


class Cartpole(Task):
    env = "cartpole"
    suite = "isaac"
    description = "to balance a pole on a cart so that the pole stays upright"
    human = REWARDS / "cartpole.py"
    score_unit, score_range = "steps the pole stays up", (0.0, 499.0)
    ends = (
        "An episode ends early when the pole is more than pi / 2 rad from upright, or the cart more than 3 m "
        "from the middle."
    )
    counts_early = True
    episode_length = 500
    time_out_early = 1
    control_dt = 0.0166
    substeps = 2
    num_observations = 4
    num_actions = 1
    clip_observations = 5.0

    spec = StateSpec(
        (
            StateVar("obs_buf", "cart position, cart velocity, pole angle, pole rate", (4,)),
            StateVar("dof_pos", "cart position [m], pole angle [rad]", (2,)),
            StateVar("dof_vel", "cart velocity [m/s], pole rate [rad/s]", (2,)),
            StateVar("cart_position", "cart position [m], 0 is the middle", use="zero_centred"),
            StateVar("cart_velocity", "cart velocity [m/s]", use="zero_centred"),
            StateVar("pole_angle", "pole angle from upright [rad]", use="zero_centred"),
            StateVar("pole_velocity", "pole rate [rad/s]", use="zero_centred"),
            StateVar("actions", "last action, force / 400 N", (1,), use="zero_centred"),
            StateVar("num_envs", "number of environments", kind="num_envs"),
        )
    )
    view = View(azimuth=180.0, elevation=-10.0)
    recipe = Recipe(hidden=(32, 32), env_steps=600_000, epochs=8, minibatches=1, critic_coef=4.0, reward_scale=0.1)

    @staticmethod
    def model() -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        spec.worldbody.add_light(pos=[0, 0, 5])
        box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "contype": 0, "conaffinity": 0}
        rail = spec.worldbody.add_body(name="rail", pos=[0, 0, 2])
        rail.add_geom(size=[0.015, 4.0, 0.015], mass=0, **box)
        cart = rail.add_body(name="cart")
        cart.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0], range=[-4, 4], limited=True)
        cart.add_geom(size=[0.1, 0.125, 0.1], mass=1, **box)
        pole = cart.add_body(name="pole", pos=[0.12, 0, 0])
        # The original damps each link's rotation by 0.5 1/s; the pole's inertia about its centre is 0.0836 kg m^2.
        pole.add_joint(name="hinge", axis=[1, 0, 0], damping=[0.5 * 0.0836, 0, 0])
        pole.add_geom(size=[0.02, 0.03, 0.5], pos=[0, 0, 0.47], mass=1, **box)
        motor = spec.add_actuator(name="force", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gear[0] = MAX_FORCE
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))

    def apply_action(self, actions: Tensor) -> None:
        self.ctrl[:] = actions

    def compute_state(self) -> dict[str, Any]:
        dof_pos, dof_vel = self.qpos.clone(), self.qvel.clone()
        return {
            "dof_pos": dof_pos,
            "dof_vel": dof_vel,
            "cart_position": dof_pos[:, 0],
            "cart_velocity": dof_vel[:, 0],
            "pole_angle": dof_pos[:, 1],
            "pole_velocity": dof_vel[:, 1],
            "actions": self.actions,
            "num_envs": self.num_envs,
        }

    def observe(self, s: State) -> Tensor:
        return torch.stack((s["cart_position"], s["cart_velocity"], s["pole_angle"], s["pole_velocity"]), dim=-1)

    def terminated(self, s: State) -> Tensor:
        return (s["cart_position"].abs() > MAX_POSITION) | (s["pole_angle"].abs() > math.pi / 2)

    def reset(self, worlds: Tensor) -> None:
        self.qpos[worlds] = self.noise.uniform(worlds, 2, -0.1, 0.1)
        self.qvel[worlds] = self.noise.uniform(worlds, 2, -0.25, 0.25)

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_episodes(self.progress, ended)

    def sparse_reward(self, s: State) -> Tensor:
        return torch.where(self.terminated(s), 0.0, 1.0)
