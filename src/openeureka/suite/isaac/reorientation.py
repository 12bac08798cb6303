"""What the tasks of one hand share: an object in the palm is turned to one goal orientation after the other, until it
falls."""

from __future__ import annotations

from typing import Any, ClassVar

import mujoco
import numpy as np
import torch
from torch import Tensor

from ...tasks.rotations import conjugate, multiply, root_state, rotation_distance, tumble, wxyz, xyzw
from ...tasks.task import Recipe, Score, State, Task, View, mean_over_episodes
from ...types import StateVar
from ..angles import scaled, unscaled
from ..assets import wheel_file

Vector = tuple[float, float, float]

FALL_DISTANCE = 0.24  # [m] between object and goal position
GOAL_BONUS = 250.0
POSITION_NOISE = 0.01  # [m] of the object's start, per axis
JOINT_NOISE = 0.2  # share of the joint ranges that start angles are drawn from
MARKER_OFFSET = (-0.2, -0.06, 0.12)  # [m] from the goal position to the picture of the goal
OBJECT, GOAL = "object", "goal"


class Reorientation(Task):
    """A fixed hand with position drives, whose joints come first in the model, and an object, whose joint comes last.

    Reaching a goal does not end the episode: the next goal is set before the next step. Goals are orientations only;
    the goal position is where the object should stay.
    """

    suite = "isaac"
    counts_early = True
    episode_length = 600
    time_out_early = 1
    score_unit, score_range = "goals reached in an episode", (0.0, None)
    ends = (
        "An episode ends early when the object is 0.24 m from its goal position; a goal reached gives way to "
        "the next one."
    )
    clip_observations = 5.0
    view = View(azimuth=80.0, elevation=-40.0)  # at the palm, from beyond the fingertips
    memory = ("goals_reached", "goal_rot")
    object_start: ClassVar[Vector]
    """Middle of the object's start positions [m]."""
    goal_position: ClassVar[Vector]
    """Where the object should stay [m]."""
    tolerance: float = 0.1
    """Angle from its goal at which the object has reached it [rad]."""
    vel_obs_scale = 0.2
    force_torque_obs_scale = 10.0

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.drive_force, self.marker = self.sim.bind("qfrc_actuator"), self.sim.bind("mocap_quat")
        model, device = self.sim.model, self.device
        self.num_dofs = model.nv - 6
        pose = torch.from_numpy(np.concatenate((model.body_pos[1], model.body_quat[1], np.zeros(6))))
        self.mount_state = pose[[0, 1, 2, 4, 5, 6, 3, *range(7, 13)]].to(device, torch.float32)
        ranges = torch.from_numpy(model.jnt_range[: self.num_dofs].T).to(device, torch.float32)
        self.dof_lower_limits, self.dof_upper_limits = ranges
        self.driven = torch.from_numpy(model.actuator_trnid[:, 0]).to(device, torch.int64)
        self.goal_pos = torch.tensor(self.goal_position, device=device).repeat(self.num_envs, 1)
        self.goal_rot = torch.tensor([0.0, 0.0, 0.0, 1.0], device=device).repeat(self.num_envs, 1)
        self.middle = torch.tensor(self.object_start, device=device)
        self.goals_reached = torch.zeros(self.num_envs, device=device)
        self.everywhere = torch.arange(self.num_envs, device=device)

    def apply_action(self, actions: Tensor) -> None:
        """Actions are joint angles, from -1 at the lower limit to 1 at the upper; the drives pull the joints there."""
        self.change_goals()
        lower, upper = self.dof_lower_limits[self.driven], self.dof_upper_limits[self.driven]
        self.ctrl[:] = unscaled(actions, lower, upper)

    def compute_state(self) -> dict[str, Any]:
        held = root_state(self.qpos[:, self.num_dofs :], self.qvel[:, self.num_dofs :])
        goal = torch.zeros_like(held)
        goal[:, :3], goal[:, 3:7] = self.goal_pos, self.goal_rot
        mount = self.mount_state.expand_as(held)
        return {
            "states_buf": torch.zeros(self.num_envs, self.num_observations, device=self.device),
            "object_pose": held[:, :7],
            "object_pos": held[:, :3],
            "object_rot": held[:, 3:7],
            "object_linvel": held[:, 7:10],
            "object_angvel": held[:, 10:],
            "goal_pose": goal[:, :7],
            "goal_pos": goal[:, :3],
            "goal_rot": goal[:, 3:7],
            "goal_states": goal,
            "shadow_hand_dof_pos": self.qpos[:, : self.num_dofs].clone(),
            "shadow_hand_dof_vel": self.qvel[:, : self.num_dofs].clone(),
            "shadow_hand_dof_lower_limits": self.dof_lower_limits,
            "shadow_hand_dof_upper_limits": self.dof_upper_limits,
            "dof_force_tensor": self.drive_force[:, : self.num_dofs].clone(),
            "actions": self.actions.clone(),
            "root_state_tensor": torch.stack((mount, held, goal), dim=1),
            "object_indices": 1,
            "vel_obs_scale": self.vel_obs_scale,
            "force_torque_obs_scale": self.force_torque_obs_scale,
            "num_shadow_hand_dofs": self.num_dofs,
            "num_actions": self.num_actions,
            "num_envs": self.num_envs,
            "rotation_distance": rotation_distance(held[:, 3:7], self.goal_rot),
        }

    def observe(self, s: State) -> Tensor:
        dof_pos = scaled(s["shadow_hand_dof_pos"], s["shadow_hand_dof_lower_limits"], s["shadow_hand_dof_upper_limits"])
        return torch.cat(
            (
                dof_pos,
                s["shadow_hand_dof_vel"] * s["vel_obs_scale"],
                s["dof_force_tensor"] * s["force_torque_obs_scale"],
                s["object_pose"],
                s["object_linvel"],
                s["object_angvel"] * s["vel_obs_scale"],
                s["goal_pose"],
                multiply(s["object_rot"], conjugate(s["goal_rot"])),
                *self.touch(s),
                s["actions"],
            ),
            dim=-1,
        )

    def touch(self, s: State) -> tuple[Tensor, ...]:
        """What the fingertips add to the observation, each (N, .)."""
        return ()

    def terminated(self, s: State) -> Tensor:
        return self._goal_distance(s) >= FALL_DISTANCE

    def reset(self, worlds: Tensor) -> None:
        """Joints near zero, the object over the palm, both at rest; drive targets are the joints' own angles."""
        noise = self.noise.uniform(worlds, self.num_dofs, self.dof_lower_limits, self.dof_upper_limits)
        angles = (JOINT_NOISE * noise).clamp(self.dof_lower_limits, self.dof_upper_limits)
        position = self.middle + self.noise.uniform(worlds, 3, -POSITION_NOISE, POSITION_NOISE)
        self.qpos[worlds] = torch.cat((angles, position, wxyz(self.start_rotation(worlds))), dim=-1)
        self.ctrl[worlds] = angles[:, self.driven]
        self.goals_reached.index_fill_(0, worlds, 0.0)
        self._set_goals(worlds, self.first_goal(worlds))

    def start_rotation(self, worlds: Tensor) -> Tensor:
        """(k, 4) orientation of the object at the start of an episode."""
        return self.random_rotation(worlds)

    def first_goal(self, worlds: Tensor) -> Tensor:
        """(k, 4) goal at the start of an episode."""
        return self.random_rotation(worlds)

    def next_goal(self) -> Tensor:
        """(N, 4) goal after the one there is now."""
        return self.random_rotation(self.everywhere)

    def random_rotation(self, worlds: Tensor) -> Tensor:
        return tumble(self.noise.uniform(worlds, 2, -1.0, 1.0))

    def change_goals(self) -> None:
        """Count the goals that the last step reached, and set the next ones there."""
        rotation = xyzw(self.qpos[:, self.num_dofs + 3 :])
        reached = (rotation_distance(rotation, self.goal_rot) <= self.tolerance) & (self.progress > 0)
        self.goals_reached += reached
        # Drawn for all worlds, used where a goal was reached: asking which worlds these are would stall a GPU.
        self._set_goals(self.everywhere, torch.where(reached[:, None], self.next_goal(), self.goal_rot))

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_episodes(self.goals_reached + self._at_goal(s), ended)

    def sparse_reward(self, s: State) -> Tensor:
        return self._at_goal(s).to(torch.float32)

    def success_bonus(self, s: State) -> Tensor:
        return GOAL_BONUS * self._at_goal(s)

    def _at_goal(self, s: State) -> Tensor:
        return s["rotation_distance"] <= self.tolerance

    def _goal_distance(self, s: State) -> Tensor:
        return torch.linalg.vector_norm(s["object_pos"] - s["goal_pos"], dim=-1)

    def _set_goals(self, worlds: Tensor, rotation: Tensor) -> None:
        self.goal_rot[worlds] = rotation
        self.marker[worlds, 0] = wxyz(rotation)


def reorientation_recipe(hidden: tuple[int, ...]) -> Recipe:
    """The original's settings on fewer worlds (16384 there, 655 M steps) and with a smaller network."""
    return Recipe(
        hidden=hidden,
        env_steps=30_000_000,
        worlds=512,
        learning_rate=5e-4,
        kl_threshold=0.016,
        critic_coef=4.0,
        reward_scale=0.01,
    )


def add_cube(spec: mujoco.MjSpec, side: float, density: float, start: Vector, goal: Vector) -> None:
    """Add the cube, a light and, beside the goal position, a picture of the goal. Faces are lettered as in the wheel.

    Call this last: `Reorientation` takes everything before it for the hand.
    """
    spec.worldbody.add_light(pos=[0, 0, 5])
    picture = wheel_file("gymnasium_robotics", "envs/assets/textures/block.png")
    texture = spec.add_texture(name=OBJECT, type=mujoco.mjtTexture.mjTEXTURE_CUBE, file=str(picture))
    texture.gridsize, texture.gridlayout = [3, 4], ".U..LFRB.D.."
    material = spec.add_material(name=OBJECT)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = OBJECT
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [side / 2] * 3, "material": OBJECT}
    cube = spec.worldbody.add_body(name=OBJECT, pos=start)
    # The original damps rotation by 0.5 1/s; on translation the same coefficient is 1e-3 1/s or less.
    inertia = density * side**5 / 6
    cube.add_joint(name=OBJECT, type=mujoco.mjtJoint.mjJNT_FREE, damping=[0.5 * inertia, 0, 0])
    cube.add_geom(name=OBJECT, density=density, contype=0, conaffinity=1, **box)
    add_marker(spec, goal).add_geom(name=GOAL, mass=0, contype=0, conaffinity=0, **box)


def add_marker(spec: mujoco.MjSpec, goal: Vector) -> mujoco.MjsBody:
    """Add a body beside the goal position that shows the goal's orientation; give it the object's looks."""
    position = [a + b for a, b in zip(goal, MARKER_OFFSET, strict=True)]
    return spec.worldbody.add_body(name=GOAL, mocap=True, pos=position)


def hand_variables(
    *, joints: str, dofs: int, actions: int, observations: int, held: str = "cube", place: str = "in the palm"
) -> tuple[StateVar, ...]:
    """The state variables of a Reorientation; words and sizes for what differs between hands and what they hold."""
    pose = "position [m], quaternion x y z w"
    moving = f"{pose}, linear velocity [m/s], angular velocity [rad/s]"
    return (
        StateVar("obs_buf", "observation of the policy, before clipping", (observations,)),
        StateVar("states_buf", "unused, zeros", (observations,)),
        StateVar("object_pose", f"{held}: {pose}, world frame", (7,)),
        StateVar("object_pos", f"position of the {held}'s centre [m], world frame", (3,), use="point"),
        StateVar("object_rot", f"orientation of the {held}, quaternion x y z w", (4,)),
        StateVar("object_linvel", f"linear velocity of the {held} [m/s], world frame", (3,), use="zero_centred"),
        StateVar("object_angvel", f"angular velocity of the {held} [rad/s], world frame", (3,), use="zero_centred"),
        StateVar("goal_pose", f"goal of the {held}: {pose}, world frame", (7,)),
        StateVar("goal_pos", f"where the {held} should stay, {place} [m], world frame", (3,), use="point"),
        StateVar("goal_rot", f"orientation the {held} should turn to, quaternion x y z w", (4,)),
        StateVar("goal_states", "goal pose, then zeros for its velocities", (13,)),
        StateVar("shadow_hand_dof_pos", f"joint angles [rad]: {joints}", (dofs,)),
        StateVar("shadow_hand_dof_vel", "joint rates [rad/s]", (dofs,), use="zero_centred"),
        StateVar("shadow_hand_dof_lower_limits", "lower joint limits [rad]", (dofs,), kind="constant"),
        StateVar("shadow_hand_dof_upper_limits", "upper joint limits [rad]", (dofs,), kind="constant"),
        StateVar("dof_force_tensor", "torques of the joint drives [N m]", (dofs,), use="zero_centred"),
        StateVar(
            "actions",
            "last action: angles the drives pull to, -1 at the lower and 1 at the upper limit",
            (actions,),
            use="zero_centred",
        ),
        StateVar("root_state_tensor", f"hand, {held} and goal in the world frame, each {moving}", (3, 13)),
        StateVar("object_indices", f"row of the {held} in root_state_tensor, 1", kind="int"),
        StateVar("vel_obs_scale", "factor of joint rates in the observation", kind="float"),
        StateVar("force_torque_obs_scale", "factor of forces in the observation", kind="float"),
        StateVar("num_shadow_hand_dofs", "number of joints", kind="int"),
        StateVar("num_actions", "number of actions", kind="int"),
        StateVar("num_envs", "number of environments", kind="num_envs"),
        StateVar(
            "rotation_distance", f"angle between the orientations of {held} and goal [rad], 0 to pi", use="zero_centred"
        ),
    )
