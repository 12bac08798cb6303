"""The formulas of Gymnasium's MuJoCo environments, version 5: observation, reward, end and start of each family."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from ...tasks.task import State
from .lifted import LiftedTask
from .task import Info

LARGEST = 10.0
"""Limit of speeds, and of one force, in observations that clip them."""


class Runner(LiftedTask):
    """Pays for speed along x and, in families that define one, a healthy pose; charges for effort."""

    has_y = False
    clipped = False
    """Whether the observation clips speeds."""

    def observation(self) -> Tensor:
        speeds = self.qvel.clamp(-LARGEST, LARGEST) if self.clipped else self.qvel
        return torch.cat((self.qpos[:, self.skipped :], speeds), dim=1)

    def info(self) -> Info:
        speed, place = self.speed(), self.qpos[:, :2]
        info = {"x_position": place[:, 0].clone(), "x_velocity": speed[:, 0].clone()}
        if self.has_y:
            info |= {"y_position": place[:, 1].clone(), "y_velocity": speed[:, 1].clone()}
            info |= {"distance_from_origin": place.norm(dim=1)}
        return info

    def healthy(self) -> Tensor | None:
        """(N,) bool; None for families that cannot fall."""
        return None

    def terminated(self, s: State) -> Tensor:
        healthy = self.healthy()
        if healthy is None or not self.constants["terminate_when_unhealthy"]:
            return super().terminated(s)
        return ~healthy

    def env_reward(self, terminated: Tensor) -> Tensor:
        paid = self.constants["forward_reward_weight"] * self.speed()[:, 0]
        paid = paid - self.constants["ctrl_cost_weight"] * self.effort()
        healthy = self.healthy()
        return paid if healthy is None else paid + self.constants["healthy_reward"] * healthy


class HalfCheetah(Runner):
    """Cannot fall."""

    normal = True


class Swimmer(Runner):
    """Moves in a plane."""

    has_y = True


class Hopper(Runner):
    """Is healthy while its torso is high and upright, and the rest of its state is within a range."""

    clipped = True

    def info(self) -> Info:
        return {**super().info(), "z_distance_from_origin": self.qpos[:, 1] - self.start[1]}

    def healthy(self) -> Tensor:
        z, angle = self.qpos[:, 1], self.qpos[:, 2]
        found = _between(z, self.constants["healthy_z_range"]) & _between(angle, self.constants["healthy_angle_range"])
        if "healthy_state_range" not in self.constants:
            return found
        state = torch.cat((self.qpos[:, 2:], self.qvel), dim=1)
        return found & _between(state, self.constants["healthy_state_range"]).all(1)


class Walker2d(Hopper):
    """Like Hopper, without a range for the rest of its state."""


class Ant(Runner):
    """Observes contact forces, and is charged for them."""

    has_y, normal, forces = True, True, True
    fields = ("cfrc_ext",)

    @classmethod
    def fits(cls, env: Any) -> bool:
        """False if `main_body` is not the body that the positions begin with: a lifted state lacks its speed."""
        return env.model.body(env._main_body).id == env.model.jnt_bodyid[0]

    def contact_forces(self) -> Tensor:
        """(N, B, 6) clipped."""
        return self.read("cfrc_ext").clamp(*self.constants["contact_force_range"])

    def observation(self) -> Tensor:
        observation = super().observation()
        if not self.constants["include_cfrc_ext_in_observation"]:
            return observation
        return torch.cat((observation, self.contact_forces()[:, 1:].flatten(1)), dim=1)

    def healthy(self) -> Tensor:
        low, high = self.constants["healthy_z_range"]
        return (self.qpos[:, 2] >= low) & (self.qpos[:, 2] <= high)

    def env_reward(self, terminated: Tensor) -> Tensor:
        contact = self.contact_forces().square().sum((1, 2))
        return super().env_reward(terminated) - self.constants["contact_cost_weight"] * contact


class Humanoid(Runner):
    """Observes contact forces, inertias and actuator forces; its speed is that of its centre of mass."""

    has_y, forces = True, True
    fields = ("xipos", "cinert", "cvel", "qfrc_actuator", "cfrc_ext", "ten_length", "ten_velocity")

    def info(self) -> Info:
        return {
            **super().info(),
            "tendon_length": self.read("ten_length"),
            "tendon_velocity": self.read("ten_velocity"),
        }

    def place(self) -> Tensor:
        """The centre of mass."""
        mass = torch.from_numpy(self.sim.model.body_mass).float().to(self.device)
        return (self.data["xipos"][:, :, :2] * mass[:, None]).sum(1) / mass.sum()

    def observation(self) -> Tensor:
        parts = [super().observation()]
        for field, skipped in (("cinert", 1), ("cvel", 1), ("qfrc_actuator", 6), ("cfrc_ext", 1)):
            if self.constants[f"include_{field}_in_observation"]:
                parts.append(self.read(field)[:, skipped:].flatten(1))
        return torch.cat(parts, dim=1)

    def healthy(self) -> Tensor:
        return _between(self.qpos[:, 2], self.constants["healthy_z_range"])

    def env_reward(self, terminated: Tensor) -> Tensor:
        contact = self.constants["contact_cost_weight"] * self.read("cfrc_ext").square().sum((1, 2))
        return super().env_reward(terminated) - contact.clamp(*self.constants["contact_cost_range"])


class Reacher(LiftedTask):
    """Pays for a fingertip that is near a target somewhere in a disc."""

    fields = ("xpos",)
    reach = 0.2
    """Radius of the disc in which targets are [m]."""

    def gap(self) -> Tensor:
        """(N, 3) from the target to the fingertip [m]."""
        places, model = self.read("xpos"), self.sim.model
        return places[:, model.body("fingertip").id] - places[:, model.body("target").id]

    def observation(self) -> Tensor:
        angles = self.qpos[:, :2]
        return torch.cat((angles.cos(), angles.sin(), self.qpos[:, 2:], self.qvel[:, :2], self.gap()[:, :2]), dim=1)

    def env_reward(self, terminated: Tensor) -> Tensor:
        distance = self.constants["reward_dist_weight"] * self.gap().norm(dim=1)
        return -distance - self.constants["reward_control_weight"] * self.effort()

    def begin(self, worlds: Tensor) -> tuple[Tensor, Tensor]:
        drawn = self.noise.uniform(worlds, 2 * len(self.start) + 2, -1.0, 1.0)
        angles, speeds, disc = drawn.split((len(self.start), len(self.start), 2), dim=1)
        # Uniform in the disc without rejection sampling: a radius by area, and an angle.
        radius, turn = self.reach * ((disc[:, :1] + 1) / 2).sqrt(), torch.pi * disc[:, 1:]
        target = torch.cat((radius * turn.cos(), radius * turn.sin()), dim=1)
        places = torch.cat(((self.start + 0.1 * angles)[:, :-2], target), dim=1)
        return places, torch.cat(((0.005 * speeds)[:, :-2], torch.zeros_like(target)), dim=1)


class Pusher(LiftedTask):
    """Pays for an object that is near its goal, and for the arm's tip being near the object."""

    fields = ("xpos",)
    apart = 0.17
    """Least distance of an object from its goal at the start [m]."""
    tries = 16
    """Places drawn for a start; the first that is far enough is taken. In one start of 10^9 none is."""

    def body(self, name: str) -> Tensor:
        """(N, 3) position of a body [m]."""
        return self.read("xpos")[:, self.sim.model.body(name).id]

    def observation(self) -> Tensor:
        bodies = [self.body(name) for name in ("tips_arm", "object", "goal")]
        return torch.cat((self.qpos[:, :7], self.qvel[:, :7], *bodies), dim=1)

    def env_reward(self, terminated: Tensor) -> Tensor:
        thing = self.body("object")
        near = self.constants["reward_near_weight"] * (thing - self.body("tips_arm")).norm(dim=1)
        far = self.constants["reward_dist_weight"] * (thing - self.body("goal")).norm(dim=1)
        return -near - far - self.constants["reward_control_weight"] * self.effort()

    def begin(self, worlds: Tensor) -> tuple[Tensor, Tensor]:
        drawn = self.noise.uniform(worlds, 2 * self.tries + 7)
        tried = drawn[:, : 2 * self.tries].unflatten(1, (self.tries, 2))
        tried = torch.stack((-0.3 * tried[..., 0], 0.4 * tried[..., 1] - 0.2), dim=-1)
        first = (tried.norm(dim=-1) > self.apart).float().argmax(1)
        thing = tried.gather(1, first[:, None, None].expand(-1, 1, 2))[:, 0]
        arm = self.start[:7].expand(len(worlds), -1)
        places = torch.cat((arm, thing, torch.zeros_like(thing)), dim=1)
        speeds = 0.01 * drawn[:, 2 * self.tries :] - 0.005
        return places, torch.cat((speeds, speeds.new_zeros(len(worlds), 4)), dim=1)


class InvertedPendulum(LiftedTask):
    """Pays for each step in which a pole stands."""

    leaning = 0.2
    """Angle beyond which it has fallen [rad]."""

    def observation(self) -> Tensor:
        return torch.cat((self.qpos, self.qvel), dim=1)

    def terminated(self, s: State) -> Tensor:
        return self.qpos[:, 1].abs() > self.leaning

    def env_reward(self, terminated: Tensor) -> Tensor:
        return (~terminated).float()


class InvertedDoublePendulum(LiftedTask):
    """Pays for each step in which two poles stand; charges for the tip's distance from its place and for speed."""

    fields, forces, normal = ("site_xpos", "qfrc_constraint"), True, True

    def observation(self) -> Tensor:
        angles = self.qpos[:, 1:]
        pushed = self.read("qfrc_constraint").clamp(-LARGEST, LARGEST)[:, :1]
        speeds = self.qvel.clamp(-LARGEST, LARGEST)
        return torch.cat((self.qpos[:, :1], angles.sin(), angles.cos(), speeds, pushed), dim=1)

    def tip(self) -> Tensor:
        """(N, 3) position of the upper pole's tip [m]."""
        return self.read("site_xpos")[:, 0]

    def terminated(self, s: State) -> Tensor:
        return self.tip()[:, 2] <= 1.0

    def env_reward(self, terminated: Tensor) -> Tensor:
        x, _, y = self.tip().unbind(1)
        first, second = self.qvel[:, 1], self.qvel[:, 2]
        away = 0.01 * x**2 + (y - 2.0) ** 2
        return self.constants["healthy_reward"] * (~terminated) - away - 0.001 * first**2 - 0.005 * second**2


def _between(value: Tensor, limits: tuple[float, float]) -> Tensor:
    low, high = limits
    return (value > low) & (value < high)


FAMILIES: Mapping[str, type[LiftedTask]] = {
    f"{family.__name__}Env": family
    for family in (
        Ant, HalfCheetah, Hopper, Humanoid, Swimmer, Walker2d,
        InvertedDoublePendulum, InvertedPendulum, Pusher, Reacher,
    )
}  # fmt: skip
"""Families by the name of Gymnasium's class."""
