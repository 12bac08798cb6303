"""What a robot's computer must know of a task to run its policies."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Literal

import mujoco

Source = Literal[
    "base_linear_velocity",
    "base_angular_velocity",
    "gravity",
    "gravity_forward",
    "commands",
    "joint_offsets",
    "joint_velocities",
    "last_action",
]
"""Velocities [m/s], [rad/s] and `gravity`, a unit vector that points down, are in the base's frame; `gravity_forward`
is (0, 0, -1) turned by the base's orientation where `gravity` is turned back, as Isaac Gym's ANYmal has it. Joint
offsets [rad] are from the default pose."""


@dataclass(frozen=True, slots=True)
class Term:
    """A part of the observation."""

    source: Source
    scale: tuple[float | str, ...]
    """Factors, one a number of it; a single one stands for all. A name is that of an attribute of the task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deployment:
    """A robot with a floating base whose actions are targets of position drives: `default pose + scale * action`.

    Actuators are in the order of the actions, and joints in the order of their actuators.
    """

    observation: tuple[Term, ...]
    default_pose: tuple[float, ...]
    """[rad]"""
    action_scale: float
    """[rad] at full action."""
    commands: tuple[tuple[str, float, float], ...] = ()
    """Name, lowest and highest that a policy was trained with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interface:
    """A `Deployment` with what the model adds; all a runtime asks for. One number a joint, in the order of actions."""

    env: str
    control_rate: float
    """[Hz] of actions."""
    simulation_rate: float
    """[Hz] of the drives in simulation."""
    joint_names: tuple[str, ...]
    default_joint_pos: tuple[float, ...]
    """[rad]"""
    joint_stiffness: tuple[float, ...]
    """[N m/rad]"""
    joint_damping: tuple[float, ...]
    """[N m s/rad]"""
    torque_limit: tuple[float, ...]
    """[N m]; infinite where nothing limits the drive."""
    action_scale: tuple[float, ...]
    """[rad] at full action."""
    observation_names: tuple[str, ...]
    observation_sizes: tuple[int, ...]
    observation_scales: tuple[float, ...]
    """One a number of the observation."""
    observation_clip: float
    observation_history: int
    command_names: tuple[str, ...]
    command_low: tuple[float, ...]
    command_high: tuple[float, ...]


def of_task(wanted: Deployment, task: type) -> Deployment:
    """The same with numbers for the names of attributes: `NAME+lin_vel_scale=1` has another."""
    terms = tuple(
        replace(term, scale=tuple(getattr(task, one) if isinstance(one, str) else one for one in term.scale))
        for term in wanted.observation
    )
    return replace(wanted, observation=terms)


def interface(
    env: str,
    wanted: Deployment,
    model: mujoco.MjModel,
    *,
    control_dt: float,
    clip: float,
    unseen: Collection[int] = (),
) -> Interface:
    """What a policy's file says beside its network.

    Args:
        control_dt: [s] between two actions.
        clip: of observations.
        unseen: columns of the task's observation that the policy does not look at; terms made of them are left out.
    """
    joints = [int(joint) for joint in model.actuator_trnid[:, 0]]
    count = len(joints)
    sizes = {"commands": len(wanted.commands)} | dict.fromkeys(
        ("joint_offsets", "joint_velocities", "last_action"), count
    )
    every = [sizes.get(term.source, 3) for term in wanted.observation]
    ends = list(accumulate(every))
    spans = [range(end - size, end) for size, end in zip(every, ends, strict=True)]
    kept = [index for index, span in enumerate(spans) if not all(column in unseen for column in span)]
    terms, parts = [wanted.observation[index] for index in kept], [every[index] for index in kept]
    scales = [
        scale
        for term, size in zip(terms, parts, strict=True)
        for scale in map(float, term.scale * size if len(term.scale) == 1 else term.scale)
    ]
    return Interface(
        env=env,
        control_rate=1.0 / control_dt,
        simulation_rate=1.0 / model.opt.timestep,
        joint_names=tuple(model.joint(joint).name for joint in joints),
        default_joint_pos=wanted.default_pose,
        joint_stiffness=tuple((-model.actuator_biasprm[:, 1]).tolist()),
        joint_damping=tuple((-model.actuator_biasprm[:, 2]).tolist()),
        torque_limit=tuple(_torque_limit(model, drive, joint) for drive, joint in enumerate(joints)),
        action_scale=(wanted.action_scale,) * count,
        observation_names=tuple(term.source for term in terms),
        observation_sizes=tuple(parts),
        observation_scales=tuple(scales),
        observation_clip=clip,
        observation_history=1,
        command_names=tuple(name for name, _, _ in wanted.commands),
        command_low=tuple(low for _, low, _ in wanted.commands),
        command_high=tuple(high for _, _, high in wanted.commands),
    )


def _torque_limit(model: mujoco.MjModel, drive: int, joint: int) -> float:
    """[N m] MuJoCo's ranges without a limit read 0 to 0."""
    limits = [
        float(found[index, 1])
        for found, limited, index in (
            (model.actuator_forcerange, model.actuator_forcelimited, drive),
            (model.jnt_actfrcrange, model.jnt_actfrclimited, joint),
        )
        if limited[index]
    ]
    return min(limits, default=math.inf)
