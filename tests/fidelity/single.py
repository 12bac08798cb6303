"""The nine Isaac tasks and the pen in one hand as their originals compute them, in NumPy, from the published formulas.

Each task is a class: `poses` puts nine worlds into states of interest, `state` gives every variable of a world,
`observe` the observation, `judge` the human reward, the failures and what F sums or averages. Deviations are marked
`ours`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import numpy as np

from openeureka.tasks.task import Task

from .dexterity import JOINTS, LOWER, UPPER
from .raw import Array, Worlds, about, angle_between, conj, mul, norm, to_unit_range, turn

N = 9
WAY = np.linspace(0, 1, N)
X, Y, Z = np.eye(3)
State = Mapping[str, Array]


def everywhere(*values: float) -> Array:
    return np.tile(np.array(values, dtype=float), (N, 1))


def each(read: Any, names: Any) -> Array:
    """(N, len(names)): what a function of one joint's name returns for each of them."""
    return np.stack([read(name) for name in names], axis=1)


def root(position: Array, quat: Array) -> Array:
    return np.concatenate((position, quat), axis=-1)


def in_frame(quat: Array, vector: Array) -> Array:
    return turn(conj(quat), vector)


class Published:
    steps: int
    """`progress` at which an episode times out."""
    reached = False
    """Whether F is a share of successes or a count of goals."""

    def poses(self, w: Worlds) -> dict[str, Array]:
        return {}

    def state(self, w: Worlds, task: Task, before: Worlds) -> dict[str, Any]:
        raise NotImplementedError

    def observe(self, s: State) -> Array:
        raise NotImplementedError

    def judge(self, s: State) -> tuple[Array, Array, Array]:
        """Human reward, failure, and the step's part of F: its value, or whether the goal is reached."""
        raise NotImplementedError

    def variants(self, s: State) -> list[dict[str, Array]]:
        return [dict(s)]

    def edges(self, s: State, f: float) -> list[dict[str, Array]]:
        """For each bound, the variables that change in a state on one side of it (f a little below 1) or on the other
        (f a little above 1)."""
        raise NotImplementedError


class Cartpole(Published):
    steps = 499

    def poses(self, w):
        return {"slide": (-3.2 + 6.4 * WAY)[:, None], "hinge": (1.7 - 3.4 * np.roll(WAY, 3))[:, None]}

    def state(self, w, task, before):
        x, theta, v, rate = w.angle("slide"), w.angle("hinge"), w.rate("slide"), w.rate("hinge")
        return {
            "dof_pos": np.stack((x, theta), axis=1), "dof_vel": np.stack((v, rate), axis=1), "cart_position": x,
            "cart_velocity": v, "pole_angle": theta, "pole_velocity": rate, "actions": task.actions, "num_envs": N,
        }  # fmt: skip

    def observe(self, s):
        return np.stack((s["dof_pos"][:, 0], s["dof_vel"][:, 0], s["dof_pos"][:, 1], s["dof_vel"][:, 1]), axis=1)

    def judge(self, s):
        (x, theta), (v, rate) = s["dof_pos"].T, s["dof_vel"].T
        failed = (np.abs(x) > 3) | (np.abs(theta) > pi / 2)
        reward = np.where(failed, -2, 1 - theta**2 - 0.01 * np.abs(v) - 0.005 * np.abs(rate))
        return reward, failed, np.where(failed, 0.0, 1.0)

    def edges(self, s, f):
        ends = [(3 * f, 0.1), (0.1, -pi / 2 * f)]
        return [
            {"dof_pos": np.tile(end, (N, 1)), "cart_position": np.full(N, end[0]), "pole_angle": np.full(N, end[1])}
            for end in ends
        ]


class Quadcopter(Published):
    steps = 499
    joints = tuple(f"rotor_{kind}{index}" for index in range(4) for kind in ("pitch", "roll"))

    def poses(self, w):
        position = np.stack((3.2 * WAY - 0.5, 0.3 * WAY, 0.2 + 1.5 * np.roll(WAY, 4)), axis=1)
        return {"chassis": root(position, mul(about(Z, 2 * WAY), about(X, 3 * WAY)))}

    def state(self, w, task, before):
        body, angles = w.body("chassis"), each(w.angle, self.joints)
        position, quat, linear, angular = body[:, :3], body[:, 3:7], body[:, 7:10], body[:, 10:]
        return {
            "root_positions": position, "root_quats": quat, "root_linvels": linear, "root_angvels": angular,
            "dof_positions": angles, "position": position, "target_position": everywhere(0, 0, 1),
            "up_proj": turn(quat, everywhere(0, 0, 1))[:, 2], "linear_velocity": linear, "angular_velocity": angular,
            "yaw_rate": angular[:, 2], "rotor_angles": angles, "actions": task.actions, "num_envs": N,
        }  # fmt: skip

    def observe(self, s):
        target = (everywhere(0, 0, 1) - s["root_positions"]) / 3
        scaled = s["root_linvels"] / 2, s["root_angvels"] / pi
        return np.concatenate((target, s["root_quats"], *scaled, s["dof_positions"]), axis=1)

    def judge(self, s):
        d = norm(s["root_positions"] - (0, 0, 1))
        tilt = np.abs(1 - turn(s["root_quats"], everywhere(0, 0, 1))[:, 2])
        spin = np.abs(s["root_angvels"][:, 2])
        reward = 1 / (1 + d**2) * (1 + 1 / (1 + tilt**2) + 1 / (1 + spin**2))
        return reward, (d > 3) | (s["root_positions"][:, 2] < 0.3), -d

    def edges(self, s, f):
        return [{"root_positions": everywhere(3 * f, 0, 1)}, {"root_positions": everywhere(0, 0, 0.3 * f)}]


class BallBalance(Published):
    steps = 499
    joints = tuple(f"{part}_leg_joint{index}" for index in range(3) for part in ("upper", "lower"))

    def poses(self, w):  # the ball is on the table, which moves; in the last worlds it has fallen
        height = np.where(WAY < 0.7, 0.665, 0.6 - 0.6 * WAY)
        return {"ball": root(np.stack((0.3 * WAY - 0.1, 0.2 - 0.3 * WAY, height), axis=1), everywhere(0, 0, 0, 1))}

    def state(self, w, task, before):
        tray, ball, wrench = w.body("tray"), w.body("ball"), w.wrench("tray")
        angles, rates = each(w.angle, self.joints), each(w.rate, self.joints)
        rim = np.array([(0.4 * np.cos(a), 0.4 * np.sin(a), 0) for a in (0, 2 * pi / 3, 4 * pi / 3)])
        forces = np.repeat(wrench[:, None, :3], 3, axis=1)  # ours: contact forces alone
        torques = wrench[:, None, 3:] - np.cross(rim[None], forces)
        normal = turn(tray[:, 3:7], everywhere(0, 0, 1))
        return {
            "ball_positions": ball[:, :3], "ball_linvels": ball[:, 7:10], "dof_positions": angles,
            "dof_velocities": rates, "sensor_forces": forces, "sensor_torques": torques, "ball_position": ball[:, :3],
            "rest_position": everywhere(0, 0, 0.6691), "ball_velocity": ball[:, 7:10],
            "ball_offset": ball[:, :2] - tray[:, :2], "ball_height": ball[:, 2],
            "table_angles": np.arctan2(normal[:, [1, 0]] * (-1, 1), normal[:, 2:]),
            "table_tilt": np.arccos(np.minimum(1, normal[:, 2])), "knee_velocities": rates[:, 1::2],
            "actions": task.actions, "num_envs": N,
        }  # fmt: skip

    def observe(self, s):
        knees = s["dof_positions"][:, 1::2], s["dof_velocities"][:, 1::2]
        touch = s["sensor_forces"][..., 0], *(s["sensor_torques"][..., axis] for axis in range(3))
        return np.concatenate((*knees, s["ball_positions"], s["ball_linvels"], *(t / 20 for t in touch)), axis=1)

    def judge(self, s):
        away, speed = norm(s["ball_positions"] - (0, 0, 0.7)), norm(s["ball_linvels"])
        failed = s["ball_positions"][:, 2] < 0.15
        return 1 / (1 + away) * 1 / (1 + speed), failed, np.where(failed, 0.0, 1.0)

    def edges(self, s, f):
        return [{"ball_positions": everywhere(0.1, 0, 0.15 * f)}]


class Runner(Published):
    steps = 999
    joints: tuple[str, ...]
    limits: tuple[Array, Array]
    feet: tuple[str, ...]
    rate_scale: float
    force_scale: float
    heights: tuple[float, float]
    fall: float
    bend: float
    """Position of a joint in its range, from -1 to 1, beyond which it is penalised."""

    def poses(self, w):
        low, high = self.heights
        position = np.stack((3 * WAY, 0.5 - WAY, high + (low - high) * np.roll(WAY, 2)), axis=1)
        quat = mul(about(Z, 2.4 * WAY - 0.83), mul(about(Y, 1.2 * np.roll(WAY, 5)), about(X, 0.05 + 0.1 * WAY)))
        lower, upper = self.limits
        angles = lower + (upper - lower) * np.roll(WAY, 1)[:, None]  # from one end of the range to the other
        angles[1:3] = np.clip(0, lower, upper)
        joints = {name: angles[:, column : column + 1] for column, name in enumerate(self.joints)}
        return {"root": root(position, quat), **joints}

    def state(self, w, task, before):
        torso = w.body("torso")
        position, quat, angular = torso[:, :3], torso[:, 3:7], torso[:, 10:]
        up, heading = turn(quat, everywhere(0, 0, 1)), turn(quat, everywhere(1, 0, 0))
        way = np.array([1000.0, 0]) - position[:, :2]
        lower, upper = self.limits
        return {
            "root_states": torso, "targets": everywhere(1000, 0, 0), "potentials": -norm(way) / 0.0166,
            "prev_potentials": -norm(np.array([1000.0, 0]) - before.body("torso")[:, :2]) / 0.0166,
            "up_vec": up, "heading_vec": heading, "dof_pos": each(w.angle, self.joints),
            "dof_vel": each(w.rate, self.joints), "dof_limits_lower": lower, "dof_limits_upper": upper,
            "vec_sensor_tensor": np.concatenate([w.wrench(foot) for foot in self.feet], axis=1),
            "actions": task.actions, "inv_start_rot": everywhere(0, 0, 0, 1), "basis_vec0": everywhere(1, 0, 0),
            "basis_vec1": everywhere(0, 0, 1), "dt": 0.0166, "dof_vel_scale": self.rate_scale,
            "contact_force_scale": self.force_scale, "torso_velocity": torso[:, 7:10],
            "torso_angular_velocity": in_frame(quat, angular), "torso_height": position[:, 2], "up_proj": up[:, 2],
            "heading_proj": (heading[:, :2] * way).sum(axis=1) / norm(way),
            "dof_pos_scaled": to_unit_range(each(w.angle, self.joints), lower, upper),
        }  # fmt: skip

    def angles(self, s: State) -> tuple[Array, Array, Array]:
        """Yaw, roll and angle to the target."""
        x, y, z, w = s["root_states"][:, 3:7].T
        roll = np.arctan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z) % (2 * pi)
        yaw = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z) % (2 * pi)
        to_target = s["targets"] - s["root_states"][:, :3]
        return yaw, roll, np.arctan2(to_target[:, 2], to_target[:, 0]) - yaw

    def posture(self, s: State) -> Array:
        heading = np.where(s["heading_proj"] > 0.8, 0.5, 0.5 * s["heading_proj"] / 0.8)
        return heading + np.where(s["up_proj"] > 0.93, 0.1, 0)

    def edges(self, s, f):
        low = s["root_states"].copy()
        low[:, 2] = self.fall * f
        up = {"torso_height": np.ones(N), "root_states": s["root_states"] + np.eye(13)[2]}  # alive, whatever the pose
        bent = s["dof_pos"].copy()
        bent[:] = sum(self.limits) / 2 + (self.limits[1] - self.limits[0]) / 2 * (1 - (1 - self.bend) / f)
        return [
            {"root_states": low, "torso_height": low[:, 2]},
            {**up, "heading_proj": np.full(N, 0.8 * f)},
            {**up, "up_proj": np.full(N, 0.93 * f)},
            {**up, "dof_pos": bent, "dof_pos_scaled": to_unit_range(bent, *self.limits)},
        ]


class Ant(Runner):
    joints = tuple(f"{part}_{leg}" for leg in range(1, 5) for part in ("hip", "ankle"))
    limits = (
        np.radians([-40.0, 30, -40, -100, -40, -100, -40, 30]),
        np.radians([40.0, 100, 40, -30, 40, -30, 40, 100]),
    )
    feet = ("front_left_foot", "front_right_foot", "left_back_foot", "right_back_foot")
    rate_scale, force_scale, heights, fall, bend = 0.2, 0.1, (0.2, 0.6), 0.31, 0.99

    def state(self, w, task, before):
        return {**super().state(w, task, before), "up_axis_idx": 2}

    def observe(self, s):
        quat = s["root_states"][:, 3:7]
        yaw, roll, to_target = self.angles(s)
        scalars = np.stack((yaw, roll, to_target, s["up_proj"], s["heading_proj"]), axis=1)
        return np.concatenate(
            (
                s["root_states"][:, 2:3], in_frame(quat, s["root_states"][:, 7:10]),
                in_frame(quat, s["root_states"][:, 10:]), scalars, to_unit_range(s["dof_pos"], *self.limits),
                0.2 * s["dof_vel"], 0.1 * s["vec_sensor_tensor"], s["actions"],
            ),
            axis=1,
        )  # fmt: skip

    def judge(self, s):
        failed = s["root_states"][:, 2] < 0.31
        progress = s["potentials"] - s["prev_potentials"]
        effort = 0.005 * (s["actions"] ** 2).sum(axis=1)
        energy = 0.05 * np.abs(s["actions"] * 0.2 * s["dof_vel"]).sum(axis=1)
        stuck = 0.1 * (to_unit_range(s["dof_pos"], *self.limits) > 0.99).sum(axis=1)
        reward = progress + 0.5 + self.posture(s) - effort - energy - stuck
        return np.where(failed, -2, reward), failed, progress


TORQUES = np.array([67.5, 67.5, 67.5, *[45, 45, 135, 90, 22.5, 22.5] * 2, *[67.5, 67.5, 45] * 2])
SPRINGS = np.array([20.0, 20, 10, *[10, 10, 20, 5, 2, 2] * 2, *[10, 10, 2] * 2])
DAMPERS = np.array([5.0, 5, 5, *[5, 5, 5, 0.1, 1, 1] * 2, *[5, 5, 1] * 2])


class Humanoid(Runner):
    joints = (
        "abdomen_z", "abdomen_y", "abdomen_x",
        *("right_" + joint for joint in ("hip_x", "hip_z", "hip_y", "knee", "ankle_y", "ankle_x")),
        *("left_" + joint for joint in ("hip_x", "hip_z", "hip_y", "knee", "ankle_y", "ankle_x")),
        *("right_" + joint for joint in ("shoulder1", "shoulder2", "elbow")),
        *("left_" + joint for joint in ("shoulder1", "shoulder2", "elbow")),
    )  # fmt: skip
    limits = (
        np.radians([-45.0, -75, -35, *[-45, -60, -120, -160, -50, -50] * 2, *[-90, -90, -90] * 2]),
        np.radians([45.0, 30, 35, *[15, 35, 45, 2, 50, 50] * 2, *[70, 70, 50] * 2]),
    )
    feet = ("right_foot", "left_foot")
    rate_scale, force_scale, heights, fall, bend = 0.1, 0.01, (0.5, 1.5), 0.8, 0.98

    def state(self, w, task, before):
        s = super().state(w, task, before)
        forces = TORQUES * s["actions"].double().numpy() - SPRINGS * s["dof_pos"] - DAMPERS * s["dof_vel"]
        return {**s, "dof_force_tensor": forces, "angular_velocity_scale": 0.25}  # ours: motor, spring and damper

    def observe(self, s):
        quat = s["root_states"][:, 3:7]
        yaw, roll, to_target = ((angle + pi) % (2 * pi) - pi for angle in self.angles(s))
        scalars = np.stack((yaw, roll, to_target, s["up_proj"], s["heading_proj"]), axis=1)
        return np.concatenate(
            (
                s["root_states"][:, 2:3], in_frame(quat, s["root_states"][:, 7:10]),
                0.25 * in_frame(quat, s["root_states"][:, 10:]), scalars, to_unit_range(s["dof_pos"], *self.limits),
                0.1 * s["dof_vel"], 0.01 * s["dof_force_tensor"], 0.01 * s["vec_sensor_tensor"], s["actions"],
            ),
            axis=1,
        )  # fmt: skip

    def judge(self, s):
        failed = s["root_states"][:, 2] < 0.8
        progress, share = s["potentials"] - s["prev_potentials"], TORQUES / 135
        effort = 0.01 * (s["actions"] ** 2).sum(axis=1)
        energy = 0.05 * (np.abs(s["actions"] * 0.1 * s["dof_vel"]) * share).sum(axis=1)
        scaled = np.abs(to_unit_range(s["dof_pos"], *self.limits))
        stuck = (0.25 * np.where(scaled > 0.98, (scaled - 0.98) / 0.02, 0) * share).sum(axis=1)
        reward = progress + 2 + self.posture(s) - effort - energy - stuck
        return np.where(failed, -1, reward), failed, progress


LEGS = {"LF": (1, 1), "LH": (-1, 1), "RF": (1, -1), "RH": (-1, -1)}


class Anymal(Published):
    steps = 2499
    joints = tuple(f"{leg}_{part}" for leg in LEGS for part in ("HAA", "HFE", "KFE"))
    bodies = ("base", *(f"{leg}_{part}" for leg in LEGS for part in ("HIP", "THIGH", "SHANK")))
    default = np.array([angle for front, left in LEGS.values() for angle in (0.03 * left, 0.4 * front, -0.8 * front)])

    def poses(self, w):
        position = np.stack((WAY, -WAY, 0.62 - 0.55 * np.roll(WAY, 4)), axis=1)
        return {"base": root(position, mul(about(Z, WAY), about(X, 2.5 * np.roll(WAY, 4))))}

    def state(self, w, task, before):
        base, angles = w.body("base"), each(w.angle, self.joints)
        commands = task.tensors()["commands"].double().numpy()
        quat = base[:, 3:7]
        linear, angular = in_frame(quat, base[:, 7:10]), in_frame(quat, base[:, 10:])
        forces = [turn(w.body(name)[:, 3:7], w.wrench(name)[:, :3]) for name in self.bodies]
        target = self.default + 0.5 * task.actions.double().numpy()
        return {
            "root_states": base, "commands": commands, "dof_pos": angles, "dof_vel": each(w.rate, self.joints),
            "default_dof_pos": np.tile(self.default, (N, 1)), "gravity_vec": everywhere(0, 0, -1),
            "actions": task.actions, "lin_vel_scale": 2.0, "ang_vel_scale": 0.25, "dof_pos_scale": 1.0,
            "dof_vel_scale": 0.05, "contact_forces": np.stack(forces, axis=1),
            "torques": np.clip(85 * (target - angles) - 2 * each(w.rate, self.joints), -80, 80),
            "base_linear_velocity": linear, "base_angular_velocity": angular,
            "velocity_error": commands[:, :2] - linear[:, :2], "yaw_rate_error": commands[:, 2] - angular[:, 2],
            "base_height": base[:, 2], "up_proj": turn(quat, everywhere(0, 0, 1))[:, 2],
            "joint_offsets": angles - self.default,
        }  # fmt: skip

    def observe(self, s):
        base = s["root_states"]
        quat, commands = base[:, 3:7], s["commands"] * (2.0, 2.0, 0.25)
        seen = (
            2 * in_frame(quat, base[:, 7:10]),
            0.25 * in_frame(quat, base[:, 10:]),
            turn(quat, everywhere(0, 0, -1)),
        )
        return np.concatenate((*seen, commands, s["dof_pos"] - self.default, 0.05 * s["dof_vel"], s["actions"]), axis=1)

    def judge(self, s):
        base = s["root_states"]
        linear, angular = in_frame(base[:, 3:7], base[:, 7:10]), in_frame(base[:, 3:7], base[:, 10:])
        away = ((s["commands"][:, :2] - linear[:, :2]) ** 2).sum(axis=1)
        yaw = (s["commands"][:, 2] - angular[:, 2]) ** 2
        dt = 0.02
        effort = 2.5e-5 * dt * (s["torques"] ** 2).sum(axis=1)
        reward = np.maximum(0, dt * np.exp(-away / 0.25) + 0.5 * dt * np.exp(-yaw / 0.25) - effort)
        force = norm(s["contact_forces"])
        failed = (force[:, 0] > 1) | (force[:, 2::3] > 1).any(axis=1)
        return reward, failed, -(away + yaw)

    def edges(self, s, f):
        found = []
        for row in range(13):
            forces = np.zeros((N, 13, 3))
            forces[:, row, 1] = f
            found.append({"contact_forces": forces})
        return found


class FrankaCabinet(Published):
    steps = 499
    reached = True
    arm = (*(f"panda_joint{index}" for index in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2")
    doors = ("door_left", "door_right", "drawer_bottom", "drawer_top")
    lower = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973, 0, 0])
    upper = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973, 0.04, 0.04])

    def poses(self, w):
        return {"drawer_top": (0.395 * WAY)[:, None], "panda_finger_joint1": (0.04 * WAY)[:, None]}

    def state(self, w, task, before):
        names = [w.model.body(index).name for index in range(1, w.model.nbody)]
        bodies = np.stack([w.body(name) for name in names], axis=1)
        link, left, right, drawer = (
            names.index(name) for name in ("panda_link7", "panda_leftfinger", "panda_rightfinger", "drawer_top")
        )
        turned = np.array([0, 0, np.sin(-pi / 8), np.cos(-pi / 8)])
        hand = bodies[:, link, :3] + turn(bodies[:, link, 3:7], everywhere(0, 0.04, 0.1654))
        handle = bodies[:, drawer, :3] + turn(bodies[:, drawer, 3:7], everywhere(0.3, 0.01, 0))
        rot = mul(bodies[:, link, 3:7], turned)  # 45 degrees from link 7's
        doors, rates = each(w.angle, self.doors), each(w.rate, self.doors)
        return {
            "franka_grasp_pos": hand, "franka_grasp_rot": rot, "drawer_grasp_pos": handle,
            "drawer_grasp_rot": everywhere(0, 0, 0, 1), "franka_lfinger_pos": bodies[:, left, :3],
            "franka_rfinger_pos": bodies[:, right, :3], "franka_lfinger_rot": bodies[:, left, 3:7],
            "franka_rfinger_rot": bodies[:, right, 3:7], "franka_dof_pos": each(w.angle, self.arm),
            "franka_dof_vel": each(w.rate, self.arm), "franka_dof_lower_limits": self.lower,
            "franka_dof_upper_limits": self.upper, "cabinet_dof_pos": doors, "cabinet_dof_vel": rates,
            "dof_vel_scale": 0.1, "rigid_body_states": bodies, "hand_handle": link, "lfinger_handle": left,
            "rfinger_handle": right, "drawer_handle": drawer, "franka_local_grasp_pos": everywhere(0, 0.04, 0.1654),
            "franka_local_grasp_rot": np.tile(turned, (N, 1)), "drawer_local_grasp_pos": everywhere(0.3, 0.01, 0),
            "drawer_local_grasp_rot": everywhere(0, 0, 0, 1), "actions": task.actions, "num_envs": N,
            "hand_position": hand, "handle_position": handle, "drawer_opening": doors[:, 3],
            "drawer_speed": rates[:, 3], "gripper_forward_proj": -turn(rot, everywhere(0, 0, 1))[:, 0],
            "gripper_up_proj": turn(rot, everywhere(0, 1, 0))[:, 2],
            "finger_gap": w.angle("panda_finger_joint1") + w.angle("panda_finger_joint2"),
            "left_finger_above_handle": bodies[:, left, 2] - handle[:, 2],
            "right_finger_below_handle": handle[:, 2] - bodies[:, right, 2],
        }  # fmt: skip

    def observe(self, s):
        to_handle = s["drawer_grasp_pos"] - s["franka_grasp_pos"]
        drawer = s["cabinet_dof_pos"][:, 3:], s["cabinet_dof_vel"][:, 3:]
        joints = to_unit_range(s["franka_dof_pos"], self.lower, self.upper), 0.1 * s["franka_dof_vel"]
        return np.concatenate((*joints, to_handle, *drawer), axis=1)

    def variants(self, s):
        """The state as it is; the hand at the handle, with fingers above and below it; the hand beside the handle; a
        finger through the drawer."""
        found = [dict(s)]
        for left, right, aside, through in ((0.02, -0.03, 0.0, 0), (-0.01, -0.03, 0.1, 0), (0.02, -0.03, 0.0, 0.05)):
            v, handle = dict(s), s["drawer_grasp_pos"]
            v["franka_grasp_pos"] = handle + np.array((0.01, aside, 0))
            v["franka_lfinger_pos"] = handle + np.array((0.01 - through, 0, left))
            v["franka_rfinger_pos"] = handle + np.array((0.01, 0, right))
            v["left_finger_above_handle"] = v["franka_lfinger_pos"][:, 2] - handle[:, 2]
            v["right_finger_below_handle"] = handle[:, 2] - v["franka_rfinger_pos"][:, 2]
            found.append(v)
        return found

    def judge(self, s):
        d, q = norm(s["franka_grasp_pos"] - s["drawer_grasp_pos"]), s["cabinet_dof_pos"][:, 3]
        zl, zr, zg = s["franka_lfinger_pos"][:, 2], s["franka_rfinger_pos"][:, 2], s["drawer_grasp_pos"][:, 2]
        around = (zl > zg) & (zg > zr)
        a = np.where(around, 0.5, 0)
        c1 = turn(s["franka_grasp_rot"], everywhere(0, 0, 1)) @ (-1, 0, 0)
        c2 = turn(s["franka_grasp_rot"], everywhere(0, 1, 0)) @ (0, 0, 1)
        near = (1 / (1 + d**2)) ** 2 * np.where(d <= 0.02, 2, 1)
        turned = 0.5 * (np.sign(c1) * c1**2 + np.sign(c2) * c2**2)
        close = np.where(around, (0.04 - np.abs(zl - zg)) + (0.04 - np.abs(zr - zg)), 0)
        reward = 2 * near + 0.5 * turned + 0.25 * a + 7.5 * (q * a + q) + 5 * close
        reward = reward - 0.01 * (s["actions"] ** 2).sum(axis=1)
        reward = reward + 0.5 * (q > 0.01) + a * (q > 0.2) + 2 * a * (q > 0.39)
        edge = s["drawer_grasp_pos"][:, 0] - 0.04
        through = (s["franka_lfinger_pos"][:, 0] < edge) | (s["franka_rfinger_pos"][:, 0] < edge)
        return np.where(through, -1, reward), q > 0.39, (q > 0.39).astype(float)

    def edges(self, s, f):
        held, handle = self.variants(s)[1], s["drawer_grasp_pos"]
        found = [{**held, "franka_grasp_pos": handle + np.array((0.02 * f, 0, 0))}]
        for opening in (0.01, 0.2, 0.39):
            doors = s["cabinet_dof_pos"].copy()
            doors[:, 3] = opening * f
            found.append({**held, "cabinet_dof_pos": doors, "drawer_opening": doors[:, 3]})
        for finger in ("franka_lfinger_pos", "franka_rfinger_pos"):
            at = held[finger].copy()
            at[:, 0] = handle[:, 0] - 0.04 * f
            found.append({**held, finger: at})
        return found


class InHand(Published):
    steps = 599
    reached = True
    joints: tuple[str, ...]
    limits: tuple[Array, Array]
    mount: tuple[tuple[float, float, float], Array]
    goal: tuple[float, float, float]
    tolerance = 0.1
    weight = -10.0

    def poses(self, w):
        """The object is off its goal orientation by 0 to 3.1 rad and moved by up to 0.1 m; in the last two worlds it is
        out of reach."""
        goal, start = w.body("goal")[:, 3:7], w.body("object")[:, :3]
        off = np.array([0.0, 0.05, 0.099, 0.15, 0.19, 0.25, 1.0, 2.0, 3.1])
        position = start + np.stack((0 * WAY, 0.1 * WAY, np.where(WAY > 0.85, 0.4, 0.0)), axis=1)
        return {"object": root(position, mul(about(X, off), goal))}

    def forces(self, w: Worlds, task: Task) -> Array:
        raise NotImplementedError

    def state(self, w, task, before):
        held, goal = w.body("object"), w.body("goal")[:, 3:7]  # ours: a marker shows the goal's orientation
        goal = np.concatenate((everywhere(*self.goal), goal, np.zeros((N, 6))), axis=1)
        mount = np.tile(np.concatenate((*self.mount, np.zeros(6))), (N, 1))
        lower, upper = self.limits
        return {
            "states_buf": np.zeros((N, task.num_observations)), "object_pose": held[:, :7], "object_pos": held[:, :3],
            "object_rot": held[:, 3:7], "object_linvel": held[:, 7:10], "object_angvel": held[:, 10:],
            "goal_pose": goal[:, :7], "goal_pos": goal[:, :3], "goal_rot": goal[:, 3:7], "goal_states": goal,
            "shadow_hand_dof_pos": each(w.angle, self.joints), "shadow_hand_dof_vel": each(w.rate, self.joints),
            "shadow_hand_dof_lower_limits": lower, "shadow_hand_dof_upper_limits": upper,
            "dof_force_tensor": self.forces(w, task), "actions": task.actions,
            "root_state_tensor": np.stack((mount, held, goal), axis=1), "object_indices": 1, "vel_obs_scale": 0.2,
            "force_torque_obs_scale": 10.0, "num_shadow_hand_dofs": len(self.joints), "num_actions": task.num_actions,
            "num_envs": N, "rotation_distance": angle_between(held[:, 3:7], goal[:, 3:7]),
        }  # fmt: skip

    def touch(self, s: State) -> tuple[Array, ...]:
        return ()

    def observe(self, s):
        joints = to_unit_range(s["shadow_hand_dof_pos"], *self.limits), 0.2 * s["shadow_hand_dof_vel"]
        held = s["object_pose"], s["object_linvel"], 0.2 * s["object_angvel"], s["goal_pose"]
        left = mul(s["object_rot"], conj(s["goal_rot"]))
        return np.concatenate((*joints, 10 * s["dof_force_tensor"], *held, left, *self.touch(s), s["actions"]), axis=1)

    def judge(self, s):
        d, theta = norm(s["object_pos"] - self.goal), angle_between(s["object_rot"], s["goal_rot"])
        hit = theta <= self.tolerance
        effort = (s["actions"] ** 2).sum(axis=1)
        return self.weight * d + 1 / (theta + 0.1) - 0.0002 * effort + 250 * hit, d >= 0.24, hit.astype(float)

    def edges(self, s, f):
        rot = mul(about(X, np.full(N, self.tolerance * f)), s["goal_rot"])
        turned = {"object_rot": rot, "rotation_distance": np.full(N, self.tolerance * f)}
        return [turned, {"object_pos": s["goal_pos"] + np.array((0, 0, 0.24 * f))}]


class AllegroHand(InHand):
    joints = tuple(f"{finger}_{index}" for finger in ("index", "middle", "ring", "thumb") for index in range(4))
    limits = (
        np.array([*[-0.558489, -0.279244, -0.279244, -0.279244] * 3, 0.279244, -0.331603, -0.279244, -0.279244]),
        np.array([*[0.558489, 1.727825, 1.727825, 1.727825] * 3, 1.570750, 1.151883, 1.727825, 1.762731]),
    )
    mount = (0, 0, 0.5), np.array([0.283045, 0.683330, -0.621782, 0.257551])
    goal = (0, -0.2, 0.52)

    def forces(self, w, task):
        lower, upper = self.limits
        target = lower + (task.actions.double().numpy() + 1) / 2 * (upper - lower)
        return np.clip(3 * (target - each(w.angle, self.joints)) - 0.1 * each(w.rate, self.joints), -0.5, 0.5)


class ShadowHand(InHand):
    joints = tuple(f"hand_{joint}" for joint in JOINTS)
    limits = LOWER, UPPER
    mount = (0, 0, 0.5), np.array([0, -(0.5**0.5), 0.5**0.5, 0.0])  # Rx(90 deg) Rz(180 deg)
    goal = (0, -0.39, 0.56)
    tips = ("ffdistal", "mfdistal", "rfdistal", "lfdistal", "thdistal")

    def forces(self, w, task):
        limit = [4.785, 2.175, *[0.9, 0.9, 0.7245] * 3, 0.9, 0.9, 0.9, 0.7245, 2.3722, 1.45, 0.99, 0.99, 0.81]
        driven = [joint for joint in range(24) if joint not in (5, 9, 13, 18)]
        target = LOWER[driven] + (task.actions.double().numpy() + 1) / 2 * (UPPER - LOWER)[driven]
        force = np.zeros((N, 24))
        stiffness = np.array([5.0, 5.0, *[1.0] * 18])
        error = target - each(w.angle, self.joints)[:, driven]
        force[:, driven] = np.clip(stiffness * error, -np.array(limit), limit)
        return force

    def state(self, w, task, before):
        names = [w.model.body(index).name for index in range(1, w.model.nbody)]
        bodies = np.stack([w.body(name) for name in names], axis=1)
        rows = np.array([7, 11, 15, 20, 25])
        return {
            **super().state(w, task, before), "rigid_body_states": bodies, "fingertip_handles": rows,
            "fingertip_state": bodies[:, rows], "fingertip_pos": bodies[:, rows, :3], "num_fingertips": 5,
            "vec_sensor_tensor": np.concatenate([w.wrench(f"hand_{tip}") for tip in self.tips], axis=1),
        }  # fmt: skip

    def touch(self, s):
        return s["fingertip_state"].reshape(N, 65), 10 * s["vec_sensor_tensor"]


class Spin(ShadowHand):
    goal = (0, -0.39, 0.48)
    tolerance = 0.156  # ours: the true angle that the original, with quaternions of unequal length, takes for 0.2 rad
    weight = 0.1


class UpsideDown(ShadowHand):
    mount = (0, 0, 0.5), mul(about(Y, pi), np.array([0, -(0.5**0.5), 0.5**0.5, 0.0]))
    goal = (0, -0.39, 0.44)
    tolerance = 0.2


PUBLISHED: Mapping[str, Published] = {
    "cartpole": Cartpole(), "quadcopter": Quadcopter(), "ballbalance": BallBalance(), "ant": Ant(),
    "humanoid": Humanoid(), "anymal": Anymal(), "franka_cabinet": FrankaCabinet(), "allegro_hand": AllegroHand(),
    "shadow_hand": ShadowHand(), "shadow_hand_spin": Spin(), "shadow_hand_upside_down": UpsideDown(),
}  # fmt: skip
