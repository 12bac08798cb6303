"""Plays policy.onnx on plain MuJoCo. It needs mujoco, onnxruntime and numpy, and what lies beside it.

    python sim2sim.py                          # ten seconds forward
    python sim2sim.py --command 0.5 0 0.5 --view

The observation is made here, from what policy.onnx says of itself: the same code reads a robot's sensors in place of
MuJoCo's state. `Controller`, with `Senses`, is all of it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

FOLDER = Path(__file__).parent


class Senses:
    """The observation of a policy and the targets of its actions, by the metadata of policy.onnx."""

    def __init__(self, facts: Mapping[str, str]) -> None:
        self.joints, self.terms, self.commands = (
            [name for name in facts[key].split(",") if name]
            for key in ("joint_names", "observation_names", "command_names")
        )
        self.default, self.scale, self.low, self.high, self.scales = (
            np.array(facts[key].split(","), float)
            for key in ("default_joint_pos", "action_scale", "target_low", "target_high", "observation_scales")
        )
        self.clip, self.rate = float(facts["observation_clip"]), float(facts["control_rate"])
        self.action = np.zeros(len(self.joints))

    def observe(
        self,
        rotation: np.ndarray,
        linear: np.ndarray,
        angular: np.ndarray,
        angles: np.ndarray,
        rates: np.ndarray,
        command: Sequence[float],
    ) -> np.ndarray:
        """The observation (O,), from the base's rotation (3, 3) to the world, its velocities in the base's frame [m/s],
        [rad/s], and the joints' angles [rad] and rates [rad/s] in the order of `joints`."""
        down = np.array([0.0, 0.0, -1.0])
        parts = {
            "base_linear_velocity": linear,
            "base_angular_velocity": angular,
            "gravity": rotation.T @ down,
            "gravity_forward": rotation @ down,
            "commands": np.asarray(command, float),
            "joint_offsets": angles - self.default,
            "joint_velocities": rates,
            "last_action": self.action,
        }
        observation = np.concatenate([parts[name] for name in self.terms]) * self.scales
        return np.clip(observation, -self.clip, self.clip).astype(np.float32)

    def targets(self) -> np.ndarray:
        """Joint targets [rad] of the last action."""
        return np.clip(self.default + self.scale * self.action, self.low, self.high)


class Controller(Senses):
    """A policy with its observation: a robot's state to joint targets."""

    def __init__(self, folder: Path = FOLDER) -> None:
        import onnxruntime  # not needed to check the observation alone

        self.session = onnxruntime.InferenceSession(str(folder / "policy.onnx"), providers=["CPUExecutionProvider"])
        super().__init__(self.session.get_modelmeta().custom_metadata_map)

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Joint targets [rad]. It keeps the action, which is part of the next observation."""
        (action,) = self.session.run(["action"], {"observation": observation[None]})
        self.action = np.asarray(action, float)[0]
        return self.targets()


class Robot:
    """What the sensors of a robot would say, read from MuJoCo."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[str]) -> None:
        self.model, self.data = model, data
        self.positions = [model.joint(name).qposadr[0] for name in joints]
        self.velocities = [model.joint(name).dofadr[0] for name in joints]
        base = int(np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
        self.place, self.speed = int(model.jnt_qposadr[base]), int(model.jnt_dofadr[base])

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotation, linear and angular velocity of the base, angles and rates of the joints, for `observe`."""
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, self.data.qpos[self.place + 3 : self.place + 7])
        rotation = rotation.reshape(3, 3)
        linear = rotation.T @ self.data.qvel[self.speed : self.speed + 3]  # MuJoCo's is in the world's frame
        angular = self.data.qvel[self.speed + 3 : self.speed + 6].copy()  # this one is in the base's frame already
        return rotation, linear, angular, self.data.qpos[self.positions], self.data.qvel[self.velocities]


def play(controller: Controller, command: Sequence[float], seconds: float, view: bool = False) -> np.ndarray:
    """Velocity of the base (steps, 3) in its own frame: forward, left [m/s], yaw rate [rad/s]."""
    model = mujoco.MjModel.from_xml_path(str(FOLDER / "scene.xml"))
    data = mujoco.MjData(model)
    robot = Robot(model, data, controller.joints)
    if model.nkey:  # drafted tasks begin at their keyframe
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[robot.positions] = controller.default
    mujoco.mj_forward(model, data)
    window = None
    if view:
        from mujoco import viewer

        window = viewer.launch_passive(model, data)
    found = []
    for _ in range(round(seconds * controller.rate)):
        began = time.monotonic()
        data.ctrl[:] = controller.act(controller.observe(*robot.state(), command))
        mujoco.mj_step(model, data, round(1.0 / controller.rate / model.opt.timestep))
        _, linear, angular, _, _ = robot.state()
        found.append([linear[0], linear[1], angular[2]])
        if window is not None:
            window.sync()
            time.sleep(max(0.0, began + 1.0 / controller.rate - time.monotonic()))
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--command", type=float, nargs="*", help="the command to follow; by default 1 and zeros")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--view", action="store_true", help="in a window")
    options = parser.parse_args()
    controller = Controller()
    if options.command is None:
        options.command = [float(place == 0) for place in range(len(controller.commands))]
    if len(options.command) != len(controller.commands):
        parser.error(f"--command takes {len(controller.commands)} numbers: {', '.join(controller.commands)}")
    speeds = play(controller, options.command, options.seconds, options.view)
    mean = speeds[len(speeds) // 2 :].mean(axis=0)
    print(f"In the second half: forward {mean[0]:.2f} m/s, left {mean[1]:.2f} m/s, turning {mean[2]:.2f} rad/s.")


if __name__ == "__main__":
    main()
