"""dm_control's suite as `server.py` steps it, in the Python that it is installed in.

State variables are the arrays of the observation, what the physics of a domain can measure (`speed` of the cheetah,
`torso_height` of the walker), and all of `qpos` and `qvel`.
"""

# The imported packages are installed in another Python.
# pyright: reportMissingImports=false

from __future__ import annotations

import copy
import ctypes.util
import inspect
import math
import os
import sys
from typing import Any

import numpy as np

_PLACES = {0: " (7: x, y, z, quaternion w, x, y, z)", 1: " (4: quaternion w, x, y, z)"}
_SPEEDS = {0: " (6: linear, angular)", 1: " (3: angular)"}
"""The numbers of free joints and ball joints, by MuJoCo's `jnt_type`."""


class Suite:
    """N environments, stepped one after another. Each has its own generator, seeded at the start of an episode."""

    seeded = True

    def __init__(self, envs: list[Any], name: str) -> None:
        self.envs, self.worlds, self.name = envs, len(envs), name
        self.broken: Any = _physics_error()
        self.moments = [env.reset() for env in envs]
        self.measures = _measures(envs[0].physics)

    def about(self) -> dict[str, Any]:
        env = self.envs[0]
        spec = env.action_spec()
        low, high = (np.broadcast_to(side, spec.shape) for side in (spec.minimum, spec.maximum))
        limit = getattr(env, "_step_limit", math.inf)
        return {
            "document": _document(env, self.name),
            "actions": {"low": low.reshape(-1), "high": high.reshape(-1)},
            "steps": math.ceil(limit) if math.isfinite(limit) else 1000,
            "dt": float(env.control_timestep()),
            "meanings": self._meanings(),
        }

    def reset(self, mask: np.ndarray, seeds: np.ndarray) -> tuple[Any, ...]:
        for world in np.flatnonzero(mask):
            env = self.envs[world]
            env.task.random.seed(int(seeds[world]))
            self.moments[world] = env.reset()
        return self._seen(), self._state()

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        reward, terminated, truncated = np.zeros((3, self.worlds))
        for world, env in enumerate(self.envs):
            try:
                moment = env.step(actions[world])
            except self.broken:
                reward[world] = math.nan  # tells the other side that this world's physics broke down
                continue
            self.moments[world] = moment
            reward[world] = moment.reward
            terminated[world] = moment.last() and moment.discount == 0.0
            truncated[world] = moment.last() and moment.discount > 0.0
        return self._seen(), reward, terminated, truncated, self._state()

    def picture(self) -> np.ndarray | None:
        physics = self.envs[0].physics
        try:
            return physics.render(480, 640, camera_id=0 if physics.model.ncam else -1)
        except Exception:  # without OpenGL, each backend raises another one
            return None

    def _seen(self) -> dict[str, np.ndarray]:
        observations = [moment.observation for moment in self.moments]
        return {name: np.stack([seen[name] for seen in observations]) for name in observations[0]}

    def _state(self) -> dict[str, np.ndarray]:
        found, worlds = self._seen(), [env.physics for env in self.envs]
        for name in self.measures:
            found[name] = np.stack([getattr(physics, name)() for physics in worlds])
        for name in ("qpos", "qvel"):
            found[name] = np.stack([getattr(physics.data, name) for physics in worlds])
        return found

    def _meanings(self) -> dict[str, str]:
        model = self.envs[0].physics.model
        joints = [(model.id2name(number, "joint"), int(kind)) for number, kind in enumerate(model.jnt_type)]
        places, speeds = (
            ", ".join(name + sizes.get(kind, "") for name, kind in joints) for sizes in (_PLACES, _SPEEDS)
        )
        found = {name: "a part of the observation" for name in self.moments[0].observation}
        found.update(self.measures)
        found["qpos"] = f"positions of the joints [rad or m]: {places}"
        found["qvel"] = f"velocity of each joint [rad/s or m/s]: {speeds}"
        return found


def _measures(physics: Any) -> dict[str, str]:
    """Numeric measures that a domain adds to dm_control's physics, methods without arguments: name -> meaning."""
    from dm_control.mujoco import Physics

    found = {}
    for name in dir(type(physics)):
        method = getattr(type(physics), name)
        if hasattr(Physics, name) or not inspect.isfunction(method) or len(inspect.signature(method).parameters) != 1:
            continue
        try:
            number = np.asarray(method(physics)).dtype.kind in "biuf"
        except Exception:  # it measures something that this task of the domain lacks: a ball, a target
            continue
        if number:
            found[name] = _sentence(method) or name.replace("_", " ")
    return found


def _document(env: Any, name: str) -> str:
    """The task's documentation in sections that `gym/documents.py` knows. That module leaves out what tells of F."""
    kind, model = type(env.task), env.physics.model
    drives = ", ".join(model.id2name(number, "actuator") for number in range(model.nu))
    parts = {
        "Description": f"The goal is to do {name} of dm_control.\n\n{_sentence(kind)}.\n\n"
        f"{_sentence(sys.modules[kind.__module__].SUITE[name.partition('-')[2]])}.",
        "Action Space": f"Controls in order: {drives}.",
        "Starting State": (inspect.getdoc(kind.initialize_episode) or "").partition("Args:")[0],
    }
    return "\n\n".join(f"## {title}\n{text}" for title, text in parts.items())


def _sentence(thing: Any) -> str:
    """The first line of its docstring."""
    said = (inspect.getdoc(thing) or "").partition("\n")[0].strip(" .")
    return said[8:] if said.startswith("Returns ") else said


def _physics_error() -> type[Exception]:
    from dm_control.rl.control import PhysicsError

    return PhysicsError


def dmc(name: str, worlds: int, settings: dict[str, Any]) -> Suite:
    """Environments of `DOMAIN-TASK`. Settings are parameters of the task's function, such as `fully_observable`."""
    if not os.environ.get("DISPLAY") and ctypes.util.find_library("EGL"):
        os.environ.setdefault("MUJOCO_GL", "egl")  # else it draws with GLFW, which needs a display
    try:
        from dm_control import suite
    except ModuleNotFoundError as error:
        raise ValueError(
            f"this Python has no module {error.name}: run python -m venv dmc, then dmc/bin/pip install dm_control "
            "'mujoco<4', and set python=dmc/bin/python"
        ) from None
    listed = [f"{domain}-{task}" for domain, task in suite.ALL_TASKS]
    domain, _, task = name.partition("-")
    if name not in listed:
        near = [other for other in listed if other.startswith(f"{domain}-")] or listed
        raise ValueError(f"dm_control has no {name}; it has {', '.join(near)}")
    given = {"random": 0, **settings}  # some domains draw their model too, and every process must have the same
    try:
        first = suite.load(domain, task, task_kwargs=given)
    except AttributeError as error:
        if "MjModel" in str(error) or "MjData" in str(error):
            import mujoco

            raise ValueError(
                f"this dm_control does not know MuJoCo {mujoco.__version__}: run pip install 'mujoco<4' in its Python"
            ) from None
        raise
    # Copied: compiling a model takes ten times as long.
    return Suite([first, *(copy.deepcopy(first) for _ in range(worlds - 1))], name)
