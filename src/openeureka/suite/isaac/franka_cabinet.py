"""FrankaCabinet: a robot arm grips the handle of a cabinet's top drawer and pulls it open."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import torch
from torch import Tensor

from ...tasks.rotations import rotate
from ...tasks.sensors import body_states
from ...tasks.task import Recipe, Score, State, Task, View
from ...types import StateSpec, StateVar
from ..angles import scaled
from ..assets import REWARDS
from .franka import MAX_LEAD, franka_spec

DEFAULT_POSE = (1.157, -1.066, -0.155, -2.239, -1.841, 1.003, 0.469, 0.035, 0.035)  # [rad] and, fingers, [m]
START_NOISE = 0.125
TARGET_STEP = (*[7.5 / 60.0] * 7, *[0.75 / 60.0] * 2)  # [rad, m] of a drive's target at full action
OPENED = 0.39  # [m] of the drawer's 0.4
HAND_GRASP = (0.0, 0.04, 0.1654)  # [m] in the frame of the last link
HAND_GRASP_ROT = (0.0, 0.0, -0.3826834, 0.9238795)  # the fingers' turn of -45 degrees about the last link's z
DRAWER_GRASP = (0.3, 0.01, 0.0)  # [m] in the drawer's frame: on the handle

# Extents [m] in the frame of each part: x, y, z from and to.
CARCASS = (
    ((-0.305, 0.331), (-0.384, 0.386), (0.373, 0.405)),  # top
    ((-0.308, 0.305), (-0.384, 0.386), (-0.384, -0.351)),  # bottom
    ((-0.308, -0.275), (-0.384, 0.386), (-0.362, 0.380)),  # back
    ((-0.284, 0.313), (-0.384, -0.358), (-0.362, 0.382)),  # sides
    ((-0.284, 0.313), (0.359, 0.385), (-0.362, 0.382)),
)
LEFT_DOOR = (((-0.01, 0.01), (0.0, 0.381), (-0.254, 0.254)),)
RIGHT_DOOR = (((-0.01, 0.01), (-0.381, 0.0), (-0.254, 0.254)),)
BOTTOM_DRAWER = (((-0.26, 0.273), (-0.382, 0.382), (-0.065, 0.065)),)
TOP_DRAWER = (
    ((0.246, 0.273), (-0.382, 0.382), (-0.064, 0.065)),  # front
    ((-0.260, -0.245), (-0.353, 0.353), (-0.045, 0.045)),  # back
    ((-0.253, 0.254), (-0.3535, -0.3385), (-0.047, 0.047)),  # sides
    ((-0.253, 0.254), (0.3385, 0.3535), (-0.047, 0.047)),
    ((-0.253, 0.254), (-0.344, 0.345), (-0.045, -0.040)),  # floor
    ((0.273, 0.312), (-0.0835, 0.0835), (-0.003, 0.021)),  # handle
)
CARCASS_MASS, DOOR_MASS, BOTTOM_DRAWER_MASS, TOP_DRAWER_MASS = 40.0, 3.9, 43.0, 5.3  # [kg]
PROP_SIZE, PROP_SPACING, PROP_DENSITY = 0.08, 0.09, 400.0  # [m], [m], [kg/m3]

Extents = tuple[tuple[float, float], ...]
_ARM = 1  # meets cabinet, cubes and floor; nothing meets its own parts
_TOUCHED = {"contype": 0, "conaffinity": _ARM}
_DARK, _WOOD, _LIGHT, _RED = [0.55, 0.42, 0.29, 1], [0.75, 0.62, 0.45, 1], [0.9, 0.79, 0.62, 1], [0.8, 0.3, 0.25, 1]
# A time constant of two substeps: fingers at 2 m/s dent a drawer by 1 cm; with MuJoCo's 20 ms they get through it.
_SOLREF, _SOLIMP = [0.011, 1.0], [0.95, 0.99, 0.001, 0.5, 2.0]


class FrankaCabinet(Task):
    env = "franka_cabinet"
    suite = "isaac"
    description = "to open the cabinet door"
    human = REWARDS / "franka_cabinet.py"
    memory = ("franka_dof_targets",)
    score_unit, score_range = "share of episodes in which it opens", (0.0, 1.0)
    scores_episodes = True
    ends = "An episode ends early as soon as the top drawer is pulled out all the way."
    episode_length = 500
    time_out_early = 1
    control_dt = 0.0166
    substeps = 3  # the original takes one
    num_observations = 23
    num_actions = 9
    clip_observations = 5.0
    view = View(azimuth=245.0, elevation=-25.0)  # at the drawers, past the arm

    spec = StateSpec(
        (
            StateVar(
                "obs_buf",
                "joint positions, -1 and 1 at their limits, joint velocities / 10, from hand to handle [m], "
                "drawer opening [m] and speed [m/s]",
                (23,),
            ),
            StateVar("franka_grasp_pos", "grasp point of the hand [m], world frame", (3,)),
            StateVar(
                "franka_grasp_rot",
                "orientation of the hand, quaternion x, y, z, w; its z axis points along the fingers, y from "
                "the right to the left finger",
                (4,),
            ),
            StateVar("drawer_grasp_pos", "grasp point on the drawer's handle [m], world frame", (3,)),
            StateVar("drawer_grasp_rot", "orientation of the drawer, quaternion x, y, z, w", (4,)),
            StateVar("franka_lfinger_pos", "left finger's base [m], world frame", (3,)),
            StateVar("franka_rfinger_pos", "right finger's base [m], world frame", (3,)),
            StateVar("franka_lfinger_rot", "left finger's quaternion x, y, z, w", (4,)),
            StateVar("franka_rfinger_rot", "right finger's quaternion x, y, z, w", (4,)),
            StateVar("franka_dof_pos", "7 joint angles [rad], left and right finger [m]", (9,)),
            StateVar("franka_dof_vel", "7 joint rates [rad/s], left and right finger [m/s]", (9,), use="zero_centred"),
            StateVar("franka_dof_lower_limits", "lower joint limits", (9,), kind="constant"),
            StateVar("franka_dof_upper_limits", "upper joint limits", (9,), kind="constant"),
            StateVar(
                "cabinet_dof_pos",
                "left and right door [rad], bottom and top drawer [m]; 0 is closed, column 3 is to be opened",
                (4,),
            ),
            StateVar("cabinet_dof_vel", "rates of the same [rad/s, m/s]", (4,)),
            StateVar("dof_vel_scale", "factor of joint velocities in the observation, 0.1", kind="float"),
            StateVar(
                "rigid_body_states",
                "arm, cabinet and cubes, world frame: position [m], quaternion x y z w, velocity [m/s], "
                "angular velocity [rad/s]",
                (31, 13),
            ),
            StateVar("hand_handle", "row of the last link in rigid_body_states", kind="int"),
            StateVar("lfinger_handle", "row of the left finger in rigid_body_states", kind="int"),
            StateVar("rfinger_handle", "row of the right finger in rigid_body_states", kind="int"),
            StateVar("drawer_handle", "row of the top drawer in rigid_body_states", kind="int"),
            StateVar("franka_local_grasp_pos", "grasp point in the last link's frame [m]", (3,)),
            StateVar("franka_local_grasp_rot", "its quaternion x, y, z, w there", (4,)),
            StateVar("drawer_local_grasp_pos", "grasp point in the drawer's frame [m]", (3,)),
            StateVar("drawer_local_grasp_rot", "its quaternion x, y, z, w there", (4,)),
            StateVar(
                "actions",
                "last action, speeds of the targets of joints and fingers, each in [-1, 1]",
                (9,),
                use="zero_centred",
            ),
            StateVar("num_envs", "number of environments", kind="num_envs"),
            StateVar("hand_position", "grasp point of the hand [m]", (3,), use="point"),
            StateVar("handle_position", "grasp point on the handle [m]", (3,), use="point"),
            StateVar(
                "drawer_opening",
                "how far the drawer, the door to open, is pulled out [m], 0 when closed, 0.4 at most",
                use="directional",
            ),
            StateVar("drawer_speed", "speed of the drawer [m/s], positive when opening", use="directional"),
            StateVar(
                "gripper_forward_proj",
                "1 when the fingers point at the cabinet, -1 when away from it",
                use="directional",
            ),
            StateVar(
                "gripper_up_proj",
                "1 when the left finger is straight above the right one, 0 when side by side",
                use="directional",
            ),
            StateVar("finger_gap", "distance between the fingers [m], 0 to 0.08", use="directional"),
            StateVar(
                "left_finger_above_handle",
                "height of the left finger over the handle [m], positive when it can close from above",
                use="directional",
            ),
            StateVar(
                "right_finger_below_handle",
                "height of the handle over the right finger [m], positive when it can close from below",
                use="directional",
            ),
        )
    )
    # The original takes 98 M steps with 4096 worlds; the drawer is open by more than 1 cm in most worlds after 0.5 M.
    recipe = Recipe(
        hidden=(128, 64), env_steps=4_000_000, epochs=5, learning_rate=5e-4, critic_coef=4.0, reward_scale=0.01
    )

    @staticmethod
    def model() -> mujoco.MjSpec:
        """The arm of the wheel in front of a cabinet made of boxes.

        The 16 cubes are fixed in the drawer. Free ones would cost five sixths of the speed; friction holds them up to
        an acceleration of 1 g, and only the drawer's inertia feels them.
        """
        spec = franka_spec(pos=[1, 0, 0], quat=[0, 0, 0, 1], contype=_ARM, conaffinity=0)
        spec.worldbody.add_light(pos=[3, -1, 3], dir=[-2, 1, -2])
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], **_TOUCHED)
        cabinet = spec.worldbody.add_body(name="cabinet", pos=[0, 0, 0.4])
        _add_boxes(cabinet, CARCASS, CARCASS_MASS, _DARK)

        hinge = {"axis": [0, 0, 1], "limited": True, "damping": [10, 0, 0], "armature": 0.005}
        left = cabinet.add_body(name="door_left", pos=[0.3162, -0.3757, -0.1297])
        left.add_joint(name="door_left", range=[-1.57, 0], **hinge)
        _add_boxes(left, LEFT_DOOR, DOOR_MASS, _WOOD)
        right = cabinet.add_body(name="door_right", pos=[0.3162, 0.3757, -0.1297])
        right.add_joint(name="door_right", range=[0, 1.57], **hinge)
        _add_boxes(right, RIGHT_DOOR, DOOR_MASS, _WOOD)

        slide = {
            **hinge,
            "type": mujoco.mjtJoint.mjJNT_SLIDE,
            "axis": [1, 0, 0],
            "range": [0, 0.4],
            "frictionloss": 0.01,
        }
        bottom = cabinet.add_body(name="drawer_bottom", pos=[0.0515, 0, 0.18795])
        bottom.add_joint(name="drawer_bottom", **slide)
        _add_boxes(bottom, BOTTOM_DRAWER, BOTTOM_DRAWER_MASS, _WOOD)
        top = cabinet.add_body(name="drawer_top", pos=[0.0515, 0, 0.3172])
        top.add_joint(name="drawer_top", **slide)
        _add_boxes(top, TOP_DRAWER, TOP_DRAWER_MASS, _LIGHT)
        for i in range(16):
            prop = top.add_body(name=f"prop{i}", pos=[(i // 4 - 1.5) * PROP_SPACING, (i % 4 - 1.5) * PROP_SPACING, 0])
            cube = [PROP_SIZE / 2] * 3
            prop.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=cube, density=PROP_DENSITY, rgba=_RED, **_TOUCHED)
        for geom in spec.geoms:
            geom.solref, geom.solimp = _SOLREF, _SOLIMP
        return spec

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.xpos, self.xquat, self.cvel = (self.sim.bind(field) for field in ("xpos", "xquat", "cvel"))
        self.subtree_com = self.sim.bind("subtree_com")
        model = self.sim.model
        self.roots = torch.from_numpy(model.body_rootid[1:].copy()).to(self.device)
        lower, upper = torch.from_numpy(model.jnt_range[:9].T.copy()).to(self.device, torch.float32)
        self.franka_dof_lower_limits, self.franka_dof_upper_limits = lower, upper
        self.default_pose, self.target_step, self.max_lead = (
            torch.tensor(values, device=self.device) for values in (DEFAULT_POSE, TARGET_STEP, MAX_LEAD)
        )
        self.franka_dof_targets = self.qpos[:, :9].clone()
        # Rows of `rigid_body_states`, which leaves out MuJoCo's body 0, the world.
        self.hand_handle, self.lfinger_handle, self.rfinger_handle, self.drawer_handle = (
            int(model.body(name).id) - 1
            for name in ("panda_link7", "panda_leftfinger", "panda_rightfinger", "drawer_top")
        )
        (
            self.franka_local_grasp_pos,
            self.franka_local_grasp_rot,
            self.drawer_local_grasp_pos,
            self.drawer_local_grasp_rot,
        ) = (
            torch.tensor(values, device=self.device).repeat(self.num_envs, 1)
            for values in (HAND_GRASP, HAND_GRASP_ROT, DRAWER_GRASP, (0.0, 0.0, 0.0, 1.0))
        )
        self.across_fingers, self.along_fingers = torch.eye(3, device=self.device)[1:]

    def apply_action(self, actions: Tensor) -> None:
        """Move the targets of the drives; a drive sees its target no further ahead than its limit of speed allows."""
        targets = self.franka_dof_targets + self.target_step * actions
        self.franka_dof_targets = targets.clamp(self.franka_dof_lower_limits, self.franka_dof_upper_limits)
        joints = self.qpos[:, :9]
        self.ctrl[:] = joints + (self.franka_dof_targets - joints).clamp(-self.max_lead, self.max_lead)

    def compute_state(self) -> dict[str, Any]:
        bodies = body_states(self.xpos[:, 1:], self.xquat[:, 1:], self.cvel[:, 1:], self.subtree_com[:, self.roots])
        hand, drawer = bodies[:, self.hand_handle], bodies[:, self.drawer_handle]
        left, right = bodies[:, self.lfinger_handle], bodies[:, self.rfinger_handle]
        hand_grasp = hand[:, :3] + rotate(hand[:, 3:7], self.franka_local_grasp_pos)
        hand_rot = left[:, 3:7]
        drawer_grasp = drawer[:, :3] + rotate(drawer[:, 3:7], self.drawer_local_grasp_pos)
        qpos, qvel = self.qpos.clone(), self.qvel.clone()
        return {
            "franka_grasp_pos": hand_grasp,
            "franka_grasp_rot": hand_rot,
            "drawer_grasp_pos": drawer_grasp,
            "drawer_grasp_rot": drawer[:, 3:7],
            "franka_lfinger_pos": left[:, :3],
            "franka_rfinger_pos": right[:, :3],
            "franka_lfinger_rot": left[:, 3:7],
            "franka_rfinger_rot": right[:, 3:7],
            "franka_dof_pos": qpos[:, :9],
            "franka_dof_vel": qvel[:, :9],
            "franka_dof_lower_limits": self.franka_dof_lower_limits,
            "franka_dof_upper_limits": self.franka_dof_upper_limits,
            "cabinet_dof_pos": qpos[:, 9:],
            "cabinet_dof_vel": qvel[:, 9:],
            "dof_vel_scale": 0.1,
            "rigid_body_states": bodies,
            "hand_handle": self.hand_handle,
            "lfinger_handle": self.lfinger_handle,
            "rfinger_handle": self.rfinger_handle,
            "drawer_handle": self.drawer_handle,
            "franka_local_grasp_pos": self.franka_local_grasp_pos,
            "franka_local_grasp_rot": self.franka_local_grasp_rot,
            "drawer_local_grasp_pos": self.drawer_local_grasp_pos,
            "drawer_local_grasp_rot": self.drawer_local_grasp_rot,
            "actions": self.actions,
            "num_envs": self.num_envs,
            "hand_position": hand_grasp,
            "handle_position": drawer_grasp,
            "drawer_opening": qpos[:, 12],
            "drawer_speed": qvel[:, 12],
            "gripper_forward_proj": -rotate(hand_rot, self.along_fingers)[:, 0],
            "gripper_up_proj": rotate(hand_rot, self.across_fingers)[:, 2],
            "finger_gap": qpos[:, 7] + qpos[:, 8],
            "left_finger_above_handle": left[:, 2] - drawer_grasp[:, 2],
            "right_finger_below_handle": drawer_grasp[:, 2] - right[:, 2],
        }

    def observe(self, s: State) -> Tensor:
        return torch.cat(
            (
                scaled(s["franka_dof_pos"], s["franka_dof_lower_limits"], s["franka_dof_upper_limits"]),
                s["franka_dof_vel"] * s["dof_vel_scale"],
                s["drawer_grasp_pos"] - s["franka_grasp_pos"],
                s["drawer_opening"][:, None],
                s["drawer_speed"][:, None],
            ),
            dim=-1,
        )

    def terminated(self, s: State) -> Tensor:
        return s["drawer_opening"] > OPENED

    def reset(self, worlds: Tensor) -> None:
        """Near the default pose, at rest, with the drives' targets there; the cabinet is closed."""
        noise = self.noise.uniform(worlds, 9, -START_NOISE, START_NOISE)
        pose = (self.default_pose + noise).clamp(self.franka_dof_lower_limits, self.franka_dof_upper_limits)
        self.qpos[worlds, :9] = pose
        self.ctrl[worlds] = pose
        self.franka_dof_targets[worlds] = pose

    def fitness(self, s: State, ended: Tensor) -> Score:
        """Share of the episodes that open the drawer.

        Each has the weight of its full length: 1 in each step, and on success all that is left. If only finished
        episodes counted, at first these would be just the ones that succeed early.
        """
        full = self.time_limit()
        opened = self.terminated(s) & ended
        weight = torch.where(opened, full + 1 - self.progress, 1).clamp(min=1).to(torch.float32)
        return Score(torch.where(opened, full / weight, 0.0), weight)

    def sparse_reward(self, s: State) -> Tensor:
        return self.terminated(s).to(torch.float32)


def _add_boxes(body: mujoco.MjsBody, boxes: tuple[Extents, ...], mass: float, rgba: list[float]) -> None:
    """Boxes of one density that weigh `mass` [kg] together."""
    lower, upper = np.moveaxis(np.array(boxes), -1, 0)
    half = (upper - lower) / 2
    density = mass / (8 * half.prod(axis=-1).sum())
    for pos, size in zip((upper + lower) / 2, half, strict=True):
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size, density=density, rgba=rgba, **_TOUCHED)
