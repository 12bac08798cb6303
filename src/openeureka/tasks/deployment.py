"""What a robot's computer must know of a task to run its policies."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import mujoco
import numpy as np

from ..codec import to_builtins
from ..errors import TaskError
from .anatomy import HINGE, ON_JOINTS, floating_joint

if TYPE_CHECKING:
    from .task import Task

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
"""Velocities [m/s], [rad/s] and `gravity`, a unit vector that points down, are in the base's frame: `gravity` is
(0, 0, -1) rotated by the inverse of the base's orientation. `gravity_forward` is rotated by the orientation itself, as
in Isaac Gym's ANYmal. Joint offsets [rad] are from the default pose."""


@dataclass(frozen=True, slots=True)
class Term:
    """A part of the observation."""

    source: Source
    scale: tuple[float | str, ...]
    """A factor for each number of the term, or a single one for all. A string names an attribute of the task."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deployment:
    """A robot with a floating base whose actions are targets of position drives: `default pose + scale * action`.

    Actuators are in the order of the actions, and joints in the order of their actuators.
    """

    observation: tuple[Term, ...]
    """All that `Task.observe` gives, in this order."""
    default_pose: tuple[float, ...]
    """[rad]"""
    action_scale: float
    """[rad] at full action."""
    commands: tuple[tuple[str, float, float], ...] = ()
    """Name, lowest and highest value that a policy was trained with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interface:
    """A `Deployment` with what the model adds: all that a runtime needs. Joints are in the order of actions."""

    env: str
    control_rate: float
    """[Hz] of actions."""
    simulation_rate: float
    """[Hz] of the drives in simulation."""
    joint_names: tuple[str, ...]
    default_joint_pos: tuple[float, ...]
    """[rad]"""
    target_low: tuple[float, ...]
    """[rad] to which the drive's target is clamped; infinite where nothing limits it."""
    target_high: tuple[float, ...]
    joint_stiffness: tuple[float, ...]
    """[N m/rad] of the drive."""
    joint_damping: tuple[float, ...]
    """[N m s/rad] of the drive."""
    passive_damping: tuple[float, ...]
    """[N m s/rad] of the joint itself, in addition to that of its drive."""
    passive_stiffness: tuple[float, ...]
    """[N m/rad] of the joint's own spring."""
    passive_rest: tuple[float, ...]
    """[rad] where that spring rests."""
    friction_loss: tuple[float, ...]
    """[N m] of dry friction, at most."""
    armature: tuple[float, ...]
    """[kg m^2] that a rotor adds to the joint's inertia."""
    torque_limit: tuple[float, ...]
    """[N m]; infinite where nothing limits the drive."""
    action_scale: tuple[float, ...]
    """[rad] at full action."""
    observation_names: tuple[str, ...]
    observation_sizes: tuple[int, ...]
    observation_scales: tuple[float, ...]
    """One per number of the observation."""
    observation_clip: float
    observation_unseen: tuple[int, ...]
    """Columns of the task's own observation that the policy does not see; the terms above leave them out."""
    observation_history: int
    command_names: tuple[str, ...]
    command_low: tuple[float, ...]
    command_high: tuple[float, ...]


def described(task: type[Task], unseen: Collection[int] = ()) -> dict[str, Any]:
    """What other programs are told of a task: its `Interface` as numbers, text and lists of them by name, or, without a
    deployment, as much of it as is known of any task.

    Raises:
        TaskError: as `interface` does.
    """
    if task.deployment is not None:
        return to_builtins(interface(task, task.compile_model(), unseen))
    known = {"env": task.env, "control_rate": 1.0 / task.control_dt, "observation_clip": task.clip_observations}
    return known | {"observation_unseen": list(unseen)} | task.acting()


def as_text(about: Mapping[str, Any]) -> dict[str, str]:
    """The same in the form that the metadata of a file have: lists as text with commas."""
    found = {name: value if isinstance(value, list | tuple) else [value] for name, value in about.items()}
    return {name: ",".join(str(value) for value in values) for name, values in found.items()}


def changed(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """The first entry that differs between two texts, or nothing. A missing entry or another `env` is no difference."""
    both = (name for name in before if name in now and name != "env")
    return next((name for name in both if not _same(before[name], now[name])), "")


def _same(before: str, now: str) -> bool:
    try:  # versions of MuJoCo may differ in the last digit
        return np.allclose(*(np.array(text.split(","), float) for text in (before, now)), rtol=1e-6, atol=1e-12)
    except ValueError:
        return before == now


def interface(task: type[Task], model: mujoco.MjModel, unseen: Collection[int]) -> Interface:
    """What a policy's file says besides its network, for a task with a `deployment`.

    Args:
        model: the task's own.
        unseen: columns of the task's observation that the policy does not see; terms made of them are left out.

    Raises:
        TaskError: where the model or the observation is not as the deployment says.
    """
    env, wanted = task.env, task.deployment
    assert wanted is not None
    _expect_drives(env, model)
    joints = [int(joint) for joint in model.actuator_trnid[:, 0]]
    dofs = [int(model.jnt_dofadr[joint]) for joint in joints]
    if len(wanted.default_pose) != len(joints):
        raise TaskError(
            f"The default pose of `{env}` has {len(wanted.default_pose)} angles, but its model has {len(joints)} "
            "actuators; give `default_pose` in its `deployment` one angle for each."
        )
    terms = _terms(task, wanted, len(joints))
    names = tuple(model.joint(joint).name for joint in joints)
    for name in (*names, *(command for command, _, _ in wanted.commands)):
        if not name or "," in name:
            raise TaskError(
                f"A joint or command of the `deployment` of `{env}` is called {name!r}, but the exported files separate"
                " names by commas; give it a name without a comma."
            )
    seen = [(name, scales) for name, scales, columns in terms if not all(column in unseen for column in columns)]
    for name, _, columns in terms:
        if 0 < sum(column in unseen for column in columns) < len(columns):
            raise TaskError(f"`unmeasured` of `{env}` hides only a part of `{name}`; hide all of it, or none of it.")
    limited = model.actuator_ctrllimited.astype(bool)
    low, high = model.actuator_ctrlrange.T
    return Interface(
        env=env,
        control_rate=1.0 / task.control_dt,
        simulation_rate=1.0 / model.opt.timestep,
        joint_names=names,
        default_joint_pos=wanted.default_pose,
        target_low=tuple(np.where(limited, low, -math.inf).tolist()),
        target_high=tuple(np.where(limited, high, math.inf).tolist()),
        joint_stiffness=tuple((-model.actuator_biasprm[:, 1]).tolist()),
        joint_damping=tuple((-model.actuator_biasprm[:, 2]).tolist()),
        passive_damping=tuple((model.dof_damping[dofs] + model.actuator_damping).tolist()),
        passive_stiffness=tuple(model.jnt_stiffness[joints].tolist()),
        passive_rest=tuple(model.qpos_spring[[int(model.jnt_qposadr[joint]) for joint in joints]].tolist()),
        friction_loss=tuple(model.dof_frictionloss[dofs].tolist()),
        armature=tuple((model.dof_armature[dofs] + model.actuator_armature).tolist()),
        torque_limit=tuple(_torque_limit(model, drive, joint) for drive, joint in enumerate(joints)),
        action_scale=(wanted.action_scale,) * len(joints),
        observation_names=tuple(name for name, _ in seen),
        observation_sizes=tuple(len(scales) for _, scales in seen),
        observation_scales=tuple(scale for _, scales in seen for scale in scales),
        observation_clip=task.clip_observations,
        observation_unseen=tuple(unseen),
        observation_history=1,
        command_names=tuple(name for name, _, _ in wanted.commands),
        command_low=tuple(low for _, low, _ in wanted.commands),
        command_high=tuple(high for _, _, high in wanted.commands),
    )


def _expect_drives(env: str, model: mujoco.MjModel) -> None:
    """Raises TaskError for a robot without a floating base, or a drive that the formula of deploy.yaml does not fit."""
    if floating_joint(model) < 0:
        raise TaskError(f"`{env}` has no floating base, which a `deployment` needs; leave its `deployment` out.")
    for drive in range(model.nu):
        gain, follows = float(model.actuator_gainprm[drive, 0]), float(-model.actuator_biasprm[drive, 1])
        if (
            model.actuator_trntype[drive] not in ON_JOINTS
            or gain != follows
            or model.actuator_gaintype[drive] != mujoco.mjtGain.mjGAIN_FIXED
            or model.actuator_biastype[drive] != mujoco.mjtBias.mjBIAS_AFFINE
            or model.actuator_gear[drive, 0] != 1.0
        ):
            raise TaskError(
                f"The actuator {model.actuator(drive).name or drive} of `{env}` is not a position actuator of one "
                "joint with gear=1, which a `deployment` needs; make it one, or leave the `deployment` out."
            )
        if problem := _beyond_formula(model, drive, int(model.actuator_trnid[drive, 0])):
            raise TaskError(
                f"The actuator {model.actuator(drive).name or drive} of `{env}` {problem}, which deploy.yaml cannot "
                "describe; change that in the model, or leave the `deployment` out of the task."
            )


def _beyond_formula(model: mujoco.MjModel, drive: int, joint: int) -> str:
    """A property of a drive or its joint that no `Interface` can hold, or nothing."""
    dof = int(model.jnt_dofadr[joint])
    forces, turns = model.actuator_forcerange[drive], model.jnt_actfrcrange[joint]
    found = {
        "moves a joint that is not a hinge": model.jnt_type[joint] != HINGE,
        "filters its target (timeconst)": model.actuator_dyntype[drive] != mujoco.mjtDyn.mjDYN_NONE,
        "is delayed (nsample, delay)": model.actuator_history[drive, 0] > 0 or model.actuator_delay[drive] > 0.0,
        "has a constant force (biasprm)": model.actuator_biasprm[drive, 0] != 0.0,
        "has a different force limit in each direction (forcerange, actuatorfrcrange)": (
            (model.actuator_forcelimited[drive] and forces[0] != -forces[1])
            or (model.jnt_actfrclimited[joint] and turns[0] != -turns[1])
        ),
        "has damping or stiffness that is not linear": (
            model.dof_dampingpoly[dof].any()
            or model.jnt_stiffnesspoly[joint].any()
            or model.actuator_dampingpoly[drive].any()
        ),
    }
    return next((problem for problem, is_so in found.items() if is_so), "")


def _terms(task: type[Task], wanted: Deployment, joints: int) -> list[tuple[Source, tuple[float, ...], range]]:
    """Name, a factor for each number, and columns of each term. A factor that names an attribute has its value, which
    `NAME+lin_vel_scale=1` changes. Raises TaskError where the terms are not the observation."""
    env, observations = task.env, task.num_observations
    sizes = {"commands": len(wanted.commands)}
    sizes |= dict.fromkeys(("joint_offsets", "joint_velocities", "last_action"), joints)
    found: list[tuple[Source, tuple[float, ...], range]] = []
    end = 0
    for term in wanted.observation:
        size = sizes.get(term.source, 3)
        given = [getattr(task, one) if isinstance(one, str) else one for one in term.scale]
        scales = tuple(map(float, given * size if len(given) == 1 else given))
        if len(scales) != size:
            raise TaskError(
                f"`{term.source}` in the `deployment` of `{env}` has {len(scales)} scales for {size} numbers; give "
                "one scale for all, or one for each."
            )
        found.append((term.source, scales, range(end, end + size)))
        end += size
    if end != observations:
        raise TaskError(
            f"The observation terms in the `deployment` of `{env}` have {end} numbers in all, but its observation has "
            f"{observations}; list all that `observe` returns, in the same order."
        )
    return found


def _torque_limit(model: mujoco.MjModel, drive: int, joint: int) -> float:
    """[N m], infinite without a limit, where MuJoCo's ranges read 0 to 0."""
    limits = [
        float(found[index, 1])
        for found, limited, index in (
            (model.actuator_forcerange, model.actuator_forcelimited, drive),
            (model.jnt_actfrcrange, model.jnt_actfrclimited, joint),
        )
        if limited[index]
    ]
    return min(limits, default=math.inf)
