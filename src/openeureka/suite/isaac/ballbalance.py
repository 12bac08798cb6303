"""BallBalance: a table on three legs catches a thrown ball and keeps it from rolling off."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import torch
from torch import Tensor

from ...tasks.rotations import rotate, rotate_inverse, xyzw
from ...tasks.sensors import add_contact_sensor
from ...tasks.task import Recipe, Score, State, Task, mean_over_episodes
from ...types import StateSpec, StateVar
from ..angles import quaternion
from ..assets import REWARDS

LEG_LENGTH = 0.36
LEG_DROP = LEG_LENGTH * math.sqrt(0.5)  # both leg parts start at 45 degrees
RIM_RADIUS = 0.4  # where legs and sensors meet the tray, and where the feet stand
FOOT_HEIGHT = 0.02
TRAY_HEIGHT = FOOT_HEIGHT + 2 * LEG_DROP + 0.03
TRAY_THICKNESS = 0.02
BALL_RADIUS = 0.1
REST_HEIGHT = TRAY_HEIGHT + TRAY_THICKNESS / 2 + BALL_RADIUS  # 0.669 m
LEG_ANGLES = (0.0, 2 * math.pi / 3, 4 * math.pi / 3)
RIM_POINTS = tuple((RIM_RADIUS * math.cos(angle), RIM_RADIUS * math.sin(angle), 0.0) for angle in LEG_ANGLES)
KNEE_LIMITS = (math.radians(-70.0), math.radians(90.0))
KNEE_SPEED = 20.0  # [rad/s] of the knee targets at full action
KNEE_STIFFNESS = 4000.0  # [N m/rad]
MAX_TORQUE = KNEE_STIFFNESS * 0.2  # [N m] one full action's pull; without a limit feet are torn 14 cm off their pins

_BALL_CONTACT = 1


class BallBalance(Task):
    env = "ballbalance"
    suite = "isaac"
    description = "to keep the ball on the table top without falling"
    human = REWARDS / "ballbalance.py"
    score_unit, score_range = "steps the ball stays on the table", (0.0, 499.0)
    ends = "An episode ends early when the ball's centre is less than 0.15 m above the ground."
    counts_early = True
    episode_length = 500
    time_out_early = 1
    control_dt = 0.01
    substeps = 2  # the original takes one; legs this stiff need 5 ms in MuJoCo
    num_observations = 24
    num_actions = 3
    clip_observations = 5.0

    spec = StateSpec(
        (
            StateVar(
                "obs_buf",
                "knee angles, knee rates, ball position, ball velocity, then of all 3 rim points sensor_forces "
                "x / 20, sensor_torques x / 20, y / 20, z / 20",
                (24,),
            ),
            StateVar("ball_positions", "ball centre x, y, z [m], world frame", (3,)),
            StateVar("ball_linvels", "ball velocity x, y, z [m/s], world frame", (3,)),
            StateVar("dof_positions", "angles of hip 0, knee 0, ..., hip 2, knee 2 [rad]", (6,)),
            StateVar("dof_velocities", "rates of hip 0, knee 0, ..., hip 2, knee 2 [rad/s]", (6,)),
            StateVar(
                "sensor_forces",
                "force of the ball on the tray [N], tray frame, the same at each of 3 rim points",
                (3, 3),
            ),
            StateVar(
                "sensor_torques", "torque of the ball on the tray about each of 3 rim points [N m], tray frame", (3, 3)
            ),
            StateVar("ball_position", "ball centre [m], world frame", (3,), use="point"),
            StateVar(
                "rest_position",
                "ball centre when it lies still in the middle of the level table [m]",
                (3,),
                use="point",
            ),
            StateVar("ball_velocity", "ball velocity [m/s]", (3,), use="zero_centred"),
            StateVar(
                "ball_offset",
                "horizontal offset of the ball from the middle of the table [m]",
                (2,),
                use="zero_centred",
            ),
            StateVar("ball_height", "height of the ball centre above the ground [m]", use="directional"),
            StateVar("table_angles", "tilt of the table about the x and the y axis [rad]", (2,), use="zero_centred"),
            StateVar("table_tilt", "angle of the table from level [rad]", use="zero_centred"),
            StateVar("knee_velocities", "knee rates [rad/s]", (3,), use="zero_centred"),
            StateVar("actions", "last action, speed of the knee targets / 20 rad/s", (3,), use="zero_centred"),
            StateVar("num_envs", "number of environments", kind="num_envs"),
        )
    )
    recipe = Recipe(
        hidden=(128, 64), env_steps=1_100_000, epochs=8, learning_rate=1e-3, critic_coef=4.0, reward_scale=0.1
    )

    @staticmethod
    def model() -> mujoco.MjSpec:
        """The original's gains, kept stable by armature on all leg joints; feet are pinned by stiff `connect`.

        Left out: contacts of the legs with each other, the tray and the ground, which the joint limits keep apart.
        """
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.worldbody.add_light(pos=[0, 0, 5])
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3, 3, 0.1], contype=0, conaffinity=0)

        tray = spec.worldbody.add_body(name="tray", pos=[0, 0, TRAY_HEIGHT])
        tray.add_freejoint(name="tray")
        tray.add_geom(
            name="tray",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[0.5, TRAY_THICKNESS / 2, 0],
            density=100,
            contype=0,
            conaffinity=_BALL_CONTACT,
        )
        for index in range(3):
            _add_leg(spec, tray, index)

        ball = spec.worldbody.add_body(name="ball", pos=[0.2, 0, 2])
        # The original damps rotation by 0.5 1/s; on translation the same coefficient is 0.002 1/s.
        ball.add_joint(name="ball", type=mujoco.mjtJoint.mjJNT_FREE, damping=[0.5 * 0.4 * 0.838 * BALL_RADIUS**2, 0, 0])
        ball.add_geom(
            name="ball",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[BALL_RADIUS, 0, 0],
            density=200,
            contype=_BALL_CONTACT,
            conaffinity=0,
        )
        field = mujoco.mjtConDataField
        wrench = field.mjCONDATA_FORCE, field.mjCONDATA_TORQUE, field.mjCONDATA_POS
        add_contact_sensor(spec, "ball", *wrench, on="tray")
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.contact = self.sim.bind("sensordata")
        self.rim_points = torch.tensor(RIM_POINTS, device=self.device)
        self.up = torch.tensor([0.0, 0.0, 1.0], device=self.device)
        self.rest_position = torch.tensor([0.0, 0.0, REST_HEIGHT], device=self.device)

    def apply_action(self, actions: Tensor) -> None:
        self.ctrl[:] = (self.ctrl + self.control_dt * KNEE_SPEED * actions).clamp(*KNEE_LIMITS)

    def compute_state(self) -> dict[str, Any]:
        qpos, qvel = self.qpos.clone(), self.qvel.clone()
        tray_position, tray_quat = qpos[:, :3], xyzw(qpos[:, 3:7])
        normal = rotate(tray_quat, self.up)
        force, torque = self._wrench(tray_position, tray_quat)
        return {
            "ball_positions": qpos[:, 13:16],
            "ball_linvels": qvel[:, 12:15],
            "dof_positions": qpos[:, 7:13],
            "dof_velocities": qvel[:, 6:12],
            "sensor_forces": force,
            "sensor_torques": torque,
            "ball_position": qpos[:, 13:16],
            "rest_position": self.rest_position.repeat(self.num_envs, 1),
            "ball_velocity": qvel[:, 12:15],
            "ball_offset": qpos[:, 13:15] - qpos[:, :2],
            "ball_height": qpos[:, 15],
            "table_angles": torch.atan2(torch.stack((-normal[:, 1], normal[:, 0]), dim=-1), normal[:, 2:]),
            "table_tilt": torch.atan2(normal[:, :2].norm(dim=-1), normal[:, 2]),
            "knee_velocities": qvel[:, 7:12:2],
            "actions": self.actions,
            "num_envs": self.num_envs,
        }

    def _wrench(self, tray_position: Tensor, tray_quat: Tensor) -> tuple[Tensor, Tensor]:
        """Force and torque (N, 3, 3) of the ball at the three rim points, in the tray's frame.

        The original's sensors report the net wrench on the tray, drives included; here it is the contact alone.
        """
        force, torque, point = self.contact.view(-1, 3, 3).unbind(1)
        force, torque, point = (rotate_inverse(tray_quat, v) for v in (force, torque, point - tray_position))
        arms = point[:, None] - self.rim_points
        forces = force[:, None].expand_as(arms)
        return forces.clone(), torque[:, None] + torch.linalg.cross(arms, forces)

    def observe(self, s: State) -> Tensor:
        knees = slice(1, None, 2)
        return torch.cat(
            (
                s["dof_positions"][:, knees],
                s["dof_velocities"][:, knees],
                s["ball_positions"],
                s["ball_linvels"],
                s["sensor_forces"][..., 0] / 20.0,
                s["sensor_torques"][..., 0] / 20.0,
                s["sensor_torques"][..., 1] / 20.0,
                s["sensor_torques"][..., 2] / 20.0,
            ),
            dim=-1,
        )

    def terminated(self, s: State) -> Tensor:
        return s["ball_positions"][:, 2] < 1.5 * BALL_RADIUS

    def reset(self, worlds: Tensor) -> None:
        """Throw the ball at the table, inwards and down; the table starts level with its targets at 0."""
        draw = self.noise.uniform(worlds, 4)
        angle = 2 * math.pi * draw[:, 0]
        outwards = torch.stack((torch.cos(angle), torch.sin(angle)), dim=-1)
        share, height, speed = draw[:, 1:2], 1.0 + draw[:, 2], 5.0 * draw[:, 3:]
        self.qpos[worlds, 13:15] = (0.001 + 0.499 * share) * outwards
        self.qpos[worlds, 15] = height
        self.qvel[worlds, 12:14] = -speed * share * outwards
        self.qvel[:, 14].index_fill_(0, worlds, -5.0)

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_episodes(self.progress, ended)

    def sparse_reward(self, s: State) -> Tensor:
        return torch.where(self.terminated(s), 0.0, 1.0)


def _add_leg(spec: mujoco.MjSpec, tray: mujoco.MjsBody, index: int) -> None:
    """A passive hip at the rim, a driven knee below and inside, a foot pinned to the ground below the hip."""
    joint = {"axis": [0, 1, 0], "limited": True, "armature": 0.1}
    geom = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "density": 1000, "contype": 0, "conaffinity": _BALL_CONTACT}
    capsule = {"size": [0.02, LEG_LENGTH / 2, 0], "pos": [0, 0, LEG_LENGTH / 2], **geom}

    x, y, _ = RIM_POINTS[index]
    downwards = quaternion(0.0, math.radians(-135.0), LEG_ANGLES[index])
    upper = tray.add_body(name=f"upper_leg{index}", pos=[x, y, -0.03], quat=downwards)
    upper.add_joint(name=f"upper_leg_joint{index}", range=[math.radians(-45), math.radians(45)], **joint)
    upper.add_geom(**capsule)
    knee_turn = quaternion(0.0, math.radians(-90.0), 0.0)
    lower = upper.add_body(name=f"lower_leg{index}", pos=[0, 0, LEG_LENGTH], quat=knee_turn)
    lower.add_joint(name=f"lower_leg_joint{index}", range=list(KNEE_LIMITS), **joint)
    lower.add_geom(**capsule)

    knee = spec.add_actuator(name=f"knee{index}", target=f"lower_leg_joint{index}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    knee.set_to_position(kp=KNEE_STIFFNESS, kv=100)
    knee.forcelimited = True
    knee.forcerange = [-MAX_TORQUE, MAX_TORQUE]
    foot = spec.add_equality(
        name=f"foot{index}",
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=f"lower_leg{index}",
        solref=[0.01, 1.0],
    )
    foot.data[:3] = [0, 0, LEG_LENGTH]
