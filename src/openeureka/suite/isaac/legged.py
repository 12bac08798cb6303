"""What legged robots share: floor, contact sensors, and, for Ant and Humanoid, running towards a target so far away
that it is a direction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import mujoco
import torch
from torch import Tensor

from ...tasks.rotations import root_state, rotate
from ...tasks.sensors import contact_wrenches
from ...tasks.task import Score, State, Task, mean_over_steps
from ...types import StateVar
from ..angles import scaled

TARGET = (1000.0, 0.0, 0.0)  # [m]


class Runner(Task):
    """A robot on a floating base whose fitness is its speed towards the target.

    The first body is the torso with a free joint; every other joint is a limited hinge with one motor, in DOF order.
    """

    score_unit = "m/s towards the target"
    time_out_early = 1
    counts_early = True
    memory = ("prev_potentials",)
    unmeasured = (("torso_height", range(0, 1)), ("torso_velocity", range(1, 4)))
    feet: ClassVar[tuple[str, ...]]
    """Bodies whose contact wrenches are state, in order."""
    start_height: ClassVar[float]
    """Torso height at reset [m]."""
    fall_height: ClassVar[float]
    """Torso height below which the episode ends [m]."""
    dof_vel_scale: ClassVar[float]
    contact_force_scale: ClassVar[float]

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.sensors = self.sim.bind("sensordata")
        lower, upper = torch.from_numpy(self.sim.model.jnt_range[1:].T).to(self.device, torch.float32)
        self.dof_limits_lower, self.dof_limits_upper = lower, upper
        self.nominal_dof_pos = torch.zeros_like(lower).clamp(lower, upper)
        self.targets = self._everywhere(TARGET)
        self.inv_start_rot = self._everywhere((0.0, 0.0, 0.0, 1.0))
        self.basis_vec0 = self._everywhere((1.0, 0.0, 0.0))
        self.basis_vec1 = self._everywhere((0.0, 0.0, 1.0))
        self.prev_potentials = self.potential(self.qpos[:, :3])

    def _everywhere(self, values: Sequence[float]) -> Tensor:
        return torch.tensor(values, device=self.device).repeat(self.num_envs, 1)

    def potential(self, position: Tensor) -> Tensor:
        """Minus the horizontal distance (k, 3) -> (k,) to the target over dt: its growth in one step is a speed [m/s].

        In float32 one step's difference is rounded to 4 mm/s; over an episode the errors cancel.
        """
        return -torch.linalg.vector_norm(position[:, :2] - self.targets[0, :2], dim=-1) / self.control_dt

    def apply_action(self, actions: Tensor) -> None:
        """Motor torque is action times gear."""
        self.prev_potentials = self.potential(self.qpos[:, :3])
        self.ctrl[:] = actions

    def compute_state(self) -> dict[str, Any]:
        root_states = root_state(self.qpos, self.qvel)
        torso_position, torso_quat = root_states[:, :3], root_states[:, 3:7]
        dof_pos = self.qpos[:, 7:].clone()
        up_vec = rotate(torso_quat, self.basis_vec1)
        heading_vec = rotate(torso_quat, self.basis_vec0)
        target_dirs = torch.nn.functional.normalize(self.targets[:, :2] - torso_position[:, :2], dim=-1)
        return {
            "root_states": root_states,
            "targets": self.targets,
            "potentials": self.potential(torso_position),
            "prev_potentials": self.prev_potentials.clone(),
            "up_vec": up_vec,
            "heading_vec": heading_vec,
            "dof_pos": dof_pos,
            "dof_vel": self.qvel[:, 6:].clone(),
            "dof_limits_lower": self.dof_limits_lower,
            "dof_limits_upper": self.dof_limits_upper,
            "vec_sensor_tensor": contact_wrenches(self.sensors, len(self.feet)).flatten(1),
            "actions": self.actions.clone(),
            "inv_start_rot": self.inv_start_rot,
            "basis_vec0": self.basis_vec0,
            "basis_vec1": self.basis_vec1,
            "dt": self.control_dt,
            "dof_vel_scale": self.dof_vel_scale,
            "contact_force_scale": self.contact_force_scale,
            "torso_velocity": root_states[:, 7:10],
            "torso_angular_velocity": self.qvel[:, 3:6].clone(),
            "torso_height": torso_position[:, 2],
            "up_proj": up_vec[:, 2],
            "heading_proj": (heading_vec[:, :2] * target_dirs).sum(dim=-1),
            "dof_pos_scaled": scaled(dof_pos, self.dof_limits_lower, self.dof_limits_upper),
        }

    def terminated(self, s: State) -> Tensor:
        return s["torso_height"] < self.fall_height

    def reset(self, worlds: Tensor) -> None:
        dofs = self.num_actions
        noise = self.noise.uniform(worlds, dofs, -0.2, 0.2)
        angles = (self.nominal_dof_pos + noise).clamp(self.dof_limits_lower, self.dof_limits_upper)
        self.qpos[:, 2].index_fill_(0, worlds, self.start_height)
        self.qpos[worlds, 7:] = angles
        self.qvel[worlds, 6:] = self.noise.uniform(worlds, dofs, -0.1, 0.1)
        self.prev_potentials[worlds] = self.potential(self.qpos[worlds, :3])

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_steps(self.sparse_reward(s))

    def sparse_reward(self, s: State) -> Tensor:
        return s["potentials"] - s["prev_potentials"]


def running_variables(*, joints: str, dofs: int, feet: int, torque: str, standing: str) -> tuple[StateVar, ...]:
    """The state variables of a Runner; words for what differs between robots."""
    return (
        StateVar(
            "root_states",
            "torso in the world frame: position [m], quaternion x y z w, linear velocity [m/s], angular "
            "velocity [rad/s]; column 7 is the forward speed",
            (13,),
        ),
        StateVar("targets", "target position [m], 1000 m ahead along x", (3,)),
        StateVar("potentials", "-(horizontal distance to the target) / dt; grows by the speed"),
        StateVar("prev_potentials", "potentials one step ago; the difference is the forward speed [m/s]"),
        StateVar("up_vec", "up axis of the torso in the world frame", (3,)),
        StateVar("heading_vec", "forward axis of the torso in the world frame", (3,)),
        StateVar("dof_pos", f"joint angles [rad]: {joints}", (dofs,)),
        StateVar("dof_vel", "joint rates [rad/s]", (dofs,), use="zero_centred"),
        StateVar("dof_limits_lower", "lower joint limits [rad]", (dofs,), kind="constant"),
        StateVar("dof_limits_upper", "upper joint limits [rad]", (dofs,), kind="constant"),
        StateVar(
            "vec_sensor_tensor", "contact force [N] and torque [N m] on each foot, in the foot's frame", (6 * feet,)
        ),
        StateVar("actions", f"last action, {torque}", (dofs,), use="zero_centred"),
        StateVar("inv_start_rot", "inverse of the start orientation, x y z w", (4,)),
        StateVar("basis_vec0", "forward axis (1, 0, 0)", (3,)),
        StateVar("basis_vec1", "up axis (0, 0, 1)", (3,)),
        StateVar("dt", "time between two actions [s]", kind="float"),
        StateVar("dof_vel_scale", "factor of joint rates in the observation", kind="float"),
        StateVar("contact_force_scale", "factor of foot wrenches in the observation", kind="float"),
        StateVar(
            "torso_velocity", "torso velocity [m/s] in the world frame: forward, left, up", (3,), use="directional"
        ),
        StateVar(
            "torso_angular_velocity", "torso angular velocity [rad/s] in the torso frame", (3,), use="zero_centred"
        ),
        StateVar("torso_height", f"torso height [m], {standing}", use="directional"),
        StateVar("up_proj", "1 when upright, 0 on the side, -1 upside down", use="directional"),
        StateVar("heading_proj", "1 when facing the target, -1 when facing away", use="directional"),
        StateVar("dof_pos_scaled", "joint angles in their range, -1 and 1 at the limits", (dofs,), use="zero_centred"),
    )


def add_floor(spec: mujoco.MjSpec, friction: float) -> None:
    spec.worldbody.add_light(pos=[0, 0, 5])
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], friction=[friction, 0.005, 0.0001]
    )
