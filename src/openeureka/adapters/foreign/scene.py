"""mjlab and Isaac Lab as `server.py` steps them, in the Python that they are installed in.

Exported rewards are computed on the same state: `export.py` copies `scene_state` and `attribute_state` from here.
"""

# The imported packages are installed in another Python.
# pyright: reportMissingImports=false

from __future__ import annotations

import inspect
import sys
from typing import Any

import numpy as np

BUFFERS = ("reward", "reset", "episode_length", "obs", "action_space", "observation_space")
"""Beginnings of the names of attributes of a direct task that are no state of the robot."""
FIELDS = {
    "root_pos": ("root_link_pos_w", "position of the root link from the origin of its environment, world frame [m]"),
    "root_quat": ("root_link_quat_w", "quaternion x, y, z, w of the root link in the world frame"),
    "root_lin_vel_w": ("root_link_lin_vel_w", "linear velocity of the root link, world frame [m/s]"),
    "root_ang_vel_w": ("root_link_ang_vel_w", "angular velocity of the root link, world frame [rad/s]"),
    "root_lin_vel_b": ("root_link_lin_vel_b", "linear velocity of the root link, in its own frame [m/s]"),
    "root_ang_vel_b": ("root_link_ang_vel_b", "angular velocity of the root link, in its own frame [rad/s]"),
    "projected_gravity": (
        "projected_gravity_b",
        "direction of gravity in the frame of the root link; 0, 0, -1 upright",
    ),
    "heading": ("heading_w", "direction of the root link about z, world frame [rad]"),
    "joint_pos": ("joint_pos", "joint positions [rad or m]"),
    "joint_pos_default": ("default_joint_pos", "joint positions of the default pose [rad or m]"),
    "joint_vel": ("joint_vel", "joint velocities [rad/s or m/s]"),
    "joint_acc": ("joint_acc", "joint accelerations [rad/s^2 or m/s^2]"),
    "actuator_force": ("actuator_force", "forces or torques of the actuators [N or N m]"),
    "applied_torque": ("applied_torque", "torques applied at the joints [N m]"),
}
"""State variable of a robot or an object -> attribute of its data, and meaning. Each `position` is a point."""


def scene_state(env: Any, fields: dict[str, str], scalar_first: bool) -> dict[str, Any]:
    """What rewards may read of a scene, tensors (N, ...) by name.

    Args:
        env: a manager-based or direct environment of mjlab or Isaac Lab.
        fields: name -> attribute of the data of a robot or an object.
        scalar_first: whether the suite's quaternions are w, x, y, z; the variables' are x, y, z, w.
    """
    scene, found = env.scene, {}
    entities = getattr(scene, "entities", None)
    if entities is None:
        entities = {**scene.articulations, **scene.rigid_objects}
    for owner, entity in entities.items():
        # The root of a terrain, or of an arm, says nothing.
        fixed = getattr(entity, "is_fixed_base", getattr(entity.data, "is_fixed_base", False))
        for name, attribute in fields.items():
            if fixed and name.startswith(("root", "projected", "heading")):
                continue
            try:
                value = getattr(entity.data, attribute)
                value = getattr(value, "torch", value).clone()
            except Exception:  # what this kind of entity does not have: joints, actuators, a free root
                continue
            if value.ndim < 1 or value.shape[0] != env.num_envs or 0 in value.shape:
                continue
            if name == "root_pos":
                value = value - scene.env_origins
            if name.endswith("_quat") and scalar_first:
                value = value.roll(-1, -1)
            found[owner + "_" + name] = value.float()
    for name, sensor in getattr(scene, "sensors", {}).items():
        for attribute in ("found", "force", "net_forces_w", "current_air_time", "current_contact_time"):
            value: Any = getattr(sensor.data, attribute, None)
            value = getattr(value, "torch", value)
            if hasattr(value, "clone") and value.ndim >= 1 and value.shape[0] == env.num_envs and 0 not in value.shape:
                found[name.replace("/", "_") + "_" + attribute] = value.clone().float()
    commands: Any = getattr(env, "command_manager", None)
    for name in getattr(commands, "active_terms", ()):
        value = commands.get_command(name)
        if hasattr(value, "clone"):
            found["command_" + name] = value.clone().float()
    if hasattr(env, "action_manager"):
        found["previous_actions"] = env.action_manager.prev_action.clone()
    return found


def attribute_state(env: Any, buffers: tuple[str, ...]) -> dict[str, Any]:
    """What a direct task keeps of its worlds: tensors (N,) to (N, a, b) among its attributes."""
    found = {}
    for name, value in vars(env).items():
        plain = hasattr(value, "is_floating_point") and value.ndim in (1, 2, 3) and value.shape[0] == env.num_envs
        if plain and not value.is_complex() and 0 not in value.shape and not name.lstrip("_").startswith(buffers):
            found[name.lstrip("_")] = value.clone().float()
    return found


class Scene:
    """A manager-based or direct environment that resets only when told to.

    Its own resets within a step are suppressed, so that the last observation of an episode is seen. The state is read
    when its own reward is computed: terms of its reward manager see the same numbers.
    """

    seeded = False  # one generator for all worlds

    def __init__(self, env: Any, document: str, *, scalar_first: bool, held: Any = None) -> None:
        self._held = held  # Isaac Lab's application ends when nothing refers to it
        self.env, self.worlds, self.document, self.scalar_first = env, env.num_envs, document, scalar_first
        self.stepping, self.state = False, {}
        begin = env._reset_idx

        def reset_when_told(*given: Any, **named: Any) -> Any:
            return None if self.stepping else begin(*given, **named)

        env._reset_idx, self._begin = reset_when_told, begin
        owner, method = (env.reward_manager, "compute") if hasattr(env, "reward_manager") else (env, "_get_rewards")
        pays = getattr(owner, method)

        def read_first(*given: Any, **named: Any) -> Any:
            self.state = self._read()
            return pays(*given, **named)

        setattr(owner, method, read_first)

    def about(self) -> dict[str, Any]:
        env = self.env
        space = getattr(env, "single_action_space", None)
        count = int(np.prod(space.shape)) if space is not None else int(env.action_manager.total_action_dim)
        return {
            "document": self.document,
            "actions": {"low": [-np.inf] * count, "high": [np.inf] * count},
            "steps": int(env.max_episode_length),
            "dt": float(env.step_dt),
            "meanings": self._meanings(),
        }

    def reset(self, mask: np.ndarray, seeds: np.ndarray) -> tuple[Any, ...]:
        torch, env = sys.modules["torch"], self.env
        worlds = torch.as_tensor(np.flatnonzero(mask), device=env.device)
        if len(worlds) == self.worlds:
            observation, _ = env.reset(seed=int(seeds[0] % 2**31))
        elif "env_ids" in inspect.signature(env.reset).parameters:
            observation, _ = env.reset(env_ids=worlds)
        else:
            self._begin(worlds)
            env.scene.write_data_to_sim()
            env.sim.forward()
            observation = env._get_observations()
        return self._seen(observation), self._read()

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        torch = sys.modules["torch"]
        self.stepping = True
        try:
            given = torch.as_tensor(actions.reshape(self.worlds, -1), device=self.env.device)
            observation, reward, terminated, truncated, _ = self.env.step(given)
        finally:
            self.stepping = False
        return self._seen(observation), reward, terminated, truncated, self.state

    def picture(self) -> np.ndarray | None:
        return None

    def _seen(self, observation: dict[str, Any]) -> dict[str, Any]:
        seen = observation[next(group for group in ("actor", "policy", *observation) if group in observation)]
        parts = [part.reshape(self.worlds, -1) for part in (seen.values() if isinstance(seen, dict) else [seen])]
        return {"": sys.modules["torch"].cat(parts, dim=1)}

    def _read(self) -> dict[str, Any]:
        fields = {name: attribute for name, (attribute, _) in FIELDS.items()}
        found = scene_state(self.env, fields, self.scalar_first)
        if not hasattr(self.env, "reward_manager"):
            found = {**attribute_state(self.env, BUFFERS), **found}
        return found

    def _meanings(self) -> dict[str, str]:
        scene, found = self.env.scene, {}
        entities = getattr(scene, "entities", None) or {**scene.articulations, **scene.rigid_objects}
        for owner, entity in entities.items():
            for name, (_, meaning) in FIELDS.items():
                joints = getattr(entity, "joint_names", ()) if name.startswith("joint") else ()
                found[owner + "_" + name] = meaning + (" of " + ", ".join(joints) if joints else "")
        for name in getattr(getattr(self.env, "command_manager", None), "active_terms", ()):
            found["command_" + name] = "what is commanded: " + name
        found["previous_actions"] = "actions of the step before"
        return found


def mjlab(name: str, worlds: int, settings: dict[str, Any]) -> Scene:
    """A task of mjlab's registry."""
    import mjlab.tasks  # noqa: F401  registers them
    from mjlab.envs import ManagerBasedRlEnv
    from mjlab.tasks.registry import list_tasks, load_env_cfg

    if name not in list_tasks():
        raise ValueError(f"mjlab has no task {name}; it has {', '.join(list_tasks())}")
    cfg = _configured(load_env_cfg(name), worlds, settings)
    return Scene(ManagerBasedRlEnv(cfg, device=settings.get("device", "cpu")), "", scalar_first=True)


def isaaclab(name: str, worlds: int, settings: dict[str, Any]) -> Scene:
    """A task that Isaac Lab registers with Gymnasium, manager-based or direct."""
    from isaaclab.app import AppLauncher

    launched = AppLauncher(headless=True)  # before anything else of Isaac Lab is imported
    import gymnasium
    import isaaclab
    import isaaclab_tasks  # noqa: F401  registers them
    from isaaclab_tasks.utils import parse_env_cfg

    device = settings.get("device", "cuda:0")
    cfg = _configured(parse_env_cfg(name, device=device, num_envs=worlds), worlds, settings)
    env = gymnasium.make(name, cfg=cfg).unwrapped
    first = int(str(getattr(isaaclab, "__version__", "2")).split(".")[0]) < 3
    return Scene(env, inspect.getdoc(type(env)) or "", scalar_first=first, held=launched)


def _configured(cfg: Any, worlds: int, settings: dict[str, Any]) -> Any:
    cfg.scene.num_envs = worlds
    for key, value in settings.items():
        if key != "device":
            if not hasattr(cfg, key):
                raise ValueError(f"its configuration has no `{key}`")
            setattr(cfg, key, value)
    return cfg
