"""What the two-handed tasks share: two Shadow Hands, and a success that counts once it is reached."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np
import torch
from torch import Tensor

from ...tasks.rotations import conjugate, multiply, rotation_distance, xyzw
from ...tasks.sensors import contact_wrenches
from ...tasks.task import Recipe, Score, State, Task, View, mean_over_episodes
from ..angles import quaternion, scaled, unscaled
from ..shadow import FINGERS
from .frames import Bodies, Frames
from .scene import HAND_BODIES, SIDES, TIPS, Pose, Scene

JOINTS = 24  # of one hand
DRIVES = 20
CONTROL_DT = 1 / 60

# PhysX damps a link by v <- (v + F h / m)(1 - c h), h = 1/120 s and c = 100 1/s, so that a force has a sixth of the
# effect it has against a drag in continuous time.
_RESPONSE = 1 - 100 / 120
_FORCE = 1e5 * CONTROL_DT * _RESPONSE  # [N] at full action and transition_scale 1
_TORQUE = 1e3 * CONTROL_DT * _RESPONSE  # [N m] at full action and orientation_scale 1


class TwoHands(Task):
    """Two Shadow Hands whose fingers follow position targets, and whose bases are fixed or driven by forces.

    A task gives the scene, names what it observes besides the hands and the object, and says when an episode fails and
    when it succeeds. Success is latched: F is the share of episodes in which it was reached at any time.
    """

    suite = "dexterity"
    control_dt = CONTROL_DT
    score_unit, score_range = "share of episodes in which it is done", (0.0, 1.0)
    ends = "No episode ends early."
    substeps = 2
    num_actions = 52
    counts_early = True  # also where an episode fails after a success: the published trainings were measured so
    view = View(azimuth=160.0, elevation=-25.0)
    scene: ClassVar[Scene]
    transition_scale: ClassVar[float] = 0.0
    orientation_scale: ClassVar[float] = 0.0
    """The original's scales of the bases' force and torque."""
    observed: ClassVar[tuple[str, ...]] = ()
    """State variables that are observed besides the hands and the object, in this order."""
    observed_point: ClassVar[str] = "hand"
    """The point whose position is observed besides the base's turn: the palm (`hand`) or the mount (`base`)."""
    memory = ("successes",)
    joint_noise: ClassVar[float] = 0.0
    """Share of the joint ranges that start angles are spread by."""
    # The original's settings on fewer worlds (2048 there, 98 M steps) and with a smaller network (512, 256, 128). Its 5
    # passes over a batch would take a CPU half as long as the physics; 2 over smaller minibatches learn as much.
    recipe = Recipe(
        hidden=(256, 128, 64),
        env_steps=5_000_000,
        epochs=2,
        minibatches=4,
        kl_threshold=0.016,
        gamma=0.96,
        critic_coef=1.0,
        bounds_coef=1e-3,
        reward_scale=0.01,
    )

    @classmethod  # static in every other task
    def model(cls) -> mujoco.MjSpec:  # pyright: ignore[reportIncompatibleMethodOverride]
        return cls.scene.build()

    def __init__(self, *args) -> None:
        super().__init__(*args)
        model, device = self.sim.model, self.device
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.drive_forces, self.pushes = (self.sim.bind(field) for field in ("qfrc_actuator", "xfrc_applied"))
        self.sensors, self.frames = self.sim.bind("sensordata"), Frames(self.sim)

        joints = [model.joint(index) for index in range(model.njnt)]
        fingers = [joint for joint in joints if joint.name.startswith(SIDES) and "base" not in joint.name]
        self.angle_columns = torch.tensor([int(joint.qposadr[0]) for joint in fingers], device=device)
        self.rate_columns = torch.tensor([int(joint.dofadr[0]) for joint in fingers], device=device)
        self.dof_lower, self.dof_upper = _float32([joint.range for joint in fingers], device).unbind(-1)
        order = [joint.id for joint in fingers]
        self.driven = torch.tensor([order.index(joint) for joint in model.actuator_trnid[:, 0]], device=device)
        self.forearms = torch.tensor([int(model.body(f"{side}_forearm").id) for side in SIDES], device=device)
        force, torque = _FORCE * self.transition_scale, _TORQUE * self.orientation_scale
        self.full_push = _float32([force] * 3 + [torque] * 3, device)

        self.start_rot = {side: xyzw(_float32(model.body(f"{side}_hand mount").quat, device)) for side in SIDES}
        self.start = _float32(model.qpos0, device)
        for name, value in self.scene.angles.items():
            self.start[int(model.joint(name).qposadr[0])] = value
        goals = torch.stack([_pose(goal, device) for goal in self.scene.goals.values()])
        self.goal_poses = goals.repeat(self.num_envs, 1, 1)
        self.marker = _pose(self.scene.marker or Pose(pos=(0, 0, 0)), device).repeat(self.num_envs, 1)
        self.bodies = Bodies(
            self.sim, 2 * HAND_BODIES, {name: placed.thing.bodies for name, placed in self.scene.things.items()}
        )
        self.fingertip_handles = torch.tensor([model.body(tip).id - 1 for tip in TIPS], device=device)
        self.successes = torch.zeros(self.num_envs, device=device)

    def apply_action(self, actions: Tensor) -> None:
        """Of each hand, right then left: force and torque on the base where it moves, then the joints' target angles,
        from -1 at the lower limit to 1 at the upper."""
        hands = actions.view(self.num_envs, 2, -1)
        targets = hands[..., -DRIVES:].flatten(1)
        self.ctrl[:] = unscaled(targets, self.dof_lower[self.driven], self.dof_upper[self.driven])
        if self.scene.hands_move:
            self.pushes[:, self.forearms] = hands[..., :6] * self.full_push

    def compute_state(self) -> dict[str, Any]:
        frames = self.frames.read()
        fingertips = torch.stack([frames[f"{tip}_state"] for tip in TIPS], dim=1)
        values = {
            **frames,
            "fingertip_state": fingertips[:, :5],
            "fingertip_pos": fingertips[:, :5, :3],
            "fingertip_another_state": fingertips[:, 5:],
            "fingertip_another_pos": fingertips[:, 5:, :3],
            "dof_pos": self.qpos.index_select(1, self.angle_columns),  # several times faster than by brackets
            "dof_vel": self.qvel.index_select(1, self.rate_columns),
            "dof_lower_limits": self.dof_lower,
            "dof_upper_limits": self.dof_upper,
            "dof_force_tensor": self.drive_forces.index_select(1, self.rate_columns),
            "vec_sensor_tensor": contact_wrenches(self.sensors, len(TIPS)).flatten(1),
            "actions": self.actions.clone(),
            "num_envs": self.num_envs,
            "rigid_body_states": self.bodies.read(),
            "fingertip_handles": self.fingertip_handles[:5],
            "fingertip_another_handles": self.fingertip_handles[5:],
            "root_state_tensor": torch.stack(
                [frames[f"{actor}_state"] for actor in ("right_base", "left_base", *self.scene.things)], dim=1
            ),
            **{f"{name}_indices": row for row, name in enumerate(self.scene.things, start=2)},
        }
        for name, pose in zip(self.scene.goals, self.goal_poses.clone().unbind(dim=1), strict=True):
            values |= {f"{name}_pose": pose, f"{name}_pos": pose[:, :3], f"{name}_rot": pose[:, 3:]}
            values[f"{name}_states"] = torch.nn.functional.pad(pose, (0, 6))
            if (thing_rot := frames.get(f"{name.replace('goal', 'object')}_rot")) is not None:
                values[name.replace("goal", "rotation_distance")] = rotation_distance(thing_rot, pose[:, 3:])
        if self.scene.marker:
            values["goal_states"] = torch.nn.functional.pad(self.marker, (0, 6))
        return {name: values[name] for name in self.spec.names if name in values}  # the original exposes no more

    def observe(self, s: State) -> Tensor:
        """The hands, the object, and what `observed` names."""
        per_hand = [
            scaled(s["dof_pos"], s["dof_lower_limits"], s["dof_upper_limits"]),
            s["dof_vel"] * 0.2,
            s["dof_force_tensor"] * 10.0,
            torch.cat((s["fingertip_state"], s["fingertip_another_state"]), dim=1),
            s["vec_sensor_tensor"] * 10.0,
            s["actions"],
        ]
        if self.scene.hands_move:
            per_hand.insert(-1, torch.cat([self._base(s, side) for side in SIDES], dim=-1))
        hands = torch.cat([part.reshape(len(part), 2, -1) for part in per_hand], dim=-1).flatten(1)
        thing = s["object_pose"], s["object_linvel"], s["object_angvel"] * 0.2
        return torch.cat((hands, *thing, *(s[name] for name in self.observed)), dim=-1)

    def _base(self, s: State, side: str) -> Tensor:
        """Where one hand is (N, 6): a position, and the turn since the start as a small-angle vector [rad].

        The original's Euler angles are singular or jump by a full turn at the start poses of most tasks.
        """
        turn = multiply(s[f"{side}_base_rot"], conjugate(self.start_rot[side]))
        return torch.cat((s[f"{side}_{self.observed_point}_pos"], 2.0 * turn[:, :3] * turn[:, 3:].sign()), dim=-1)

    def terminated(self, s: State) -> Tensor:
        """Never, unless a task says how it fails."""
        return torch.zeros(self.num_envs, dtype=torch.bool, device=self.device)

    def reset(self, worlds: Tensor) -> None:
        """Everything at rest at its start; drive targets are the joints' own angles."""
        self.qpos[worlds] = self.start
        angles = self.start[self.angle_columns].repeat(len(worlds), 1)
        if self.joint_noise:
            turns = self.noise.uniform(worlds, JOINTS, -1.0, 1.0).repeat(1, 2)  # the hands share a draw
            spread = self.dof_lower + (self.dof_upper - self.dof_lower) * turns
            angles = (angles + self.joint_noise * spread).clamp(self.dof_lower, self.dof_upper)
            self.qpos[worlds[:, None], self.angle_columns] = angles
        self.ctrl[worlds] = angles[:, self.driven]
        self.successes = self.successes.index_fill(0, worlds, 0.0)

    @abstractmethod
    def success(self, s: State) -> Tensor:
        """(N,) what the task is worth as of now: 1 (or True) when it is done, 0 when not."""

    def outcome(self, s: State) -> Tensor:
        """The first success of an episode counts until its end."""
        self.successes = torch.where(self.successes > 0.0, self.successes, self.success(s).to(torch.float32))
        return self.successes

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_episodes(s["outcome"], ended)

    def sparse_reward(self, s: State) -> Tensor:
        return s["outcome"]

    def ghosts(self) -> Mapping[str, Tensor]:
        """Each thing at its own goal, where the goal's position means something."""
        pairs = zip(self.scene.things, self.scene.goals, self.goal_poses.unbind(dim=1), strict=False)
        return {thing: pose for thing, goal, pose in pairs if self.spec[f"{goal}_pos"].use == "point"}

    def thing_columns(self, name: str) -> slice:
        """Columns of `qpos` that hold a free thing's position and orientation (w, x, y, z)."""
        start = int(self.sim.model.joint(name).qposadr[0])
        return slice(start, start + 7)


def finger_distances(s: State, side: str, point: Tensor) -> Tensor:
    """Sum over the five fingers of one hand of the distances to a point (N, 3)."""
    fingers = torch.stack([s[f"{side}_hand_{finger}_pos"] for finger in FINGERS], dim=1)
    return distance(fingers, point[:, None]).sum(dim=-1)


def distance(a: Tensor, b: Tensor) -> Tensor:
    """Between points (..., 3) [m]."""
    return torch.linalg.vector_norm(a - b, dim=-1)


def towards_goal(s: State, thing: str = "object", goal: str = "goal") -> Tensor:
    """What is observed of a goal (N, 11): its pose and the turn that is left."""
    return torch.cat((s[f"{goal}_pose"], multiply(s[f"{thing}_rot"], conjugate(s[f"{goal}_rot"]))), dim=-1)


def _pose(pose: Pose, device: torch.device) -> Tensor:
    """(7,)"""
    w, *vector = quaternion(*pose.euler)
    return _float32((*pose.pos, *vector, w), device)


def _float32(values: Any, device: torch.device) -> Tensor:
    return torch.tensor(np.asarray(values), dtype=torch.float32, device=device)
