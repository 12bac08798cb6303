"""ManiSkill as `server.py` steps it, in the Python that it is installed in.

State variables are the arrays of the observation `state_dict`, without the group `extra` in their names, and the
numbers in `info`. The `success` there is called `is_success`, so that F can be the share of episodes that succeed.
"""

# The imported packages are installed in another Python.
# pyright: reportMissingImports=false

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

_ON_CPU = ("cpu", "physx_cpu")
_SECTIONS = {"Task Description": "Description", "Randomizations": "Starting State"}
"""Titles in the documentation of a task -> what `gym/documents.py` calls them."""


class Batches:
    """N worlds in batches: one batch on a GPU, N batches of one world on the CPU, where physics has a single world.

    A batch has one generator. So an episode follows from its seed only in a batch of one world.
    """

    def __init__(self, envs: list[Any]) -> None:
        self.envs, self.size = envs, envs[0].unwrapped.num_envs
        self.worlds, self.seeded = len(envs) * self.size, self.size == 1
        self.last: list[Any] = [None] * len(envs)
        """Observation and info of each batch."""

    def about(self) -> dict[str, Any]:
        from mani_skill.utils.gym_utils import find_max_episode_steps_value

        env, inner = self.envs[0], self.envs[0].unwrapped
        space = inner.single_action_space
        self.reset(np.ones(self.worlds, bool), np.arange(self.worlds))
        return {
            "document": _document(inspect.getdoc(type(inner)) or ""),
            "actions": {"low": space.low.astype(float).tolist(), "high": space.high.astype(float).tolist()},
            "steps": int(find_max_episode_steps_value(env) or 1000),
            "dt": 1.0 / inner.control_freq,
            "meanings": {name: _meaning(name, inner.agent) for name in self._state()},
        }

    def reset(self, mask: np.ndarray, seeds: np.ndarray) -> tuple[Any, ...]:
        torch = sys.modules["torch"]
        for number, (env, worlds) in enumerate(self._batches()):
            begun = np.flatnonzero(mask[worlds])
            if len(begun) == self.size:
                torch.manual_seed(int(seeds[worlds][0]))  # for what later resets of some of its worlds draw
                self.last[number] = env.reset(seed=[int(seed) for seed in seeds[worlds]])
            elif len(begun):
                which = torch.as_tensor(begun, device=env.unwrapped.device)
                self.last[number] = env.reset(options={"env_idx": which})
        return self._seen(), self._state()

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        torch, paid = sys.modules["torch"], []
        for number, (env, worlds) in enumerate(self._batches()):
            given = torch.as_tensor(actions[worlds], device=env.unwrapped.device)
            observation, *told, info = env.step(given)
            self.last[number] = observation, info
            paid.append(told)
        reward, terminated, truncated = (torch.cat([part.reshape(-1) for part in parts]) for parts in zip(*paid))  # noqa: B905  not in Python 3.8
        return self._seen(), reward, terminated, truncated, self._state()

    def picture(self) -> np.ndarray | None:
        return None

    def _batches(self) -> Iterator[tuple[Any, slice]]:
        for number, env in enumerate(self.envs):
            yield env, slice(number * self.size, (number + 1) * self.size)

    def _seen(self) -> dict[str, Any]:
        return _joined([dict(_arrays(observation)) for observation, _ in self.last])

    def _state(self) -> dict[str, Any]:
        told = [{**_numbers(info, self.size), **dict(_arrays(observation))} for observation, info in self.last]
        return _joined(told)


def _arrays(observation: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for key, value in observation.items():
        inner = (*path, key)
        if isinstance(value, dict):
            yield from _arrays(value, inner)
        elif 0 not in value.shape:
            yield re.sub(r"\W", "_", "_".join(inner[1:] if inner[0] == "extra" else inner)), value


def _numbers(info: dict[str, Any], worlds: int) -> dict[str, Any]:
    found = {name: value for name, value in info.items() if getattr(value, "shape", ())[:1] == (worlds,)}
    if "success" in found:
        found["is_success"] = found.pop("success")
    return found


def _joined(batches: list[dict[str, Any]]) -> dict[str, Any]:
    return {name: sys.modules["torch"].cat([batch[name] for batch in batches]) for name in batches[0]}


def _meaning(name: str, agent: Any) -> str:
    joints = ", ".join(joint.name for joint in agent.robot.active_joints) if hasattr(agent, "robot") else ""
    known = {
        "agent_qpos": f"positions of the joints [rad or m]: {joints}",
        "agent_qvel": f"velocity of each joint [rad/s or m/s]: {joints}",
    }
    if name in known:
        return known[name].rstrip(": ")
    if "_to_" in name and name.endswith("_pos"):
        return "vector from the one to the other [m]"
    if name.endswith("_pos"):
        return "position [m]"
    return "x, y, z [m], then quaternion w, x, y, z" if name.endswith("_pose") else ""


def _document(text: str) -> str:
    """A task's documentation with titles in Markdown."""
    return re.sub(
        r"^\*\*(.+?):?\*\*:?", lambda found: f"## {_SECTIONS.get(found[1], found[1])}\n", text, flags=re.MULTILINE
    )


def maniskill(name: str, worlds: int, settings: dict[str, Any]) -> Batches:
    """Environments of an id that ManiSkill registers. Settings are parameters of its class, such as `control_mode`."""
    try:
        import gymnasium
        import mani_skill.envs  # noqa: F401  registers them
        from mani_skill.utils.registration import REGISTERED_ENVS
    except ModuleNotFoundError as error:
        raise ValueError(
            f"this Python has no module {error.name}: run python -m venv maniskill, then maniskill/bin/pip install "
            "mani_skill torch, and set python=maniskill/bin/python"
        ) from None
    if name not in REGISTERED_ENVS:
        raise ValueError(f"ManiSkill has no {name}; it has {', '.join(sorted(REGISTERED_ENVS))}")
    given = {"obs_mode": "state_dict", "render_backend": "none", **settings}
    if "sim_backend" not in given:
        import torch

        given["sim_backend"] = "physx_cuda" if torch.cuda.is_available() else "physx_cpu"
    size = 1 if given["sim_backend"] in _ON_CPU else worlds
    try:
        envs: list[Any] = [gymnasium.make(name, num_envs=size, **given) for _ in range(worlds // size)]
    except EOFError:
        raise ValueError(
            f"its assets are missing: run python -m mani_skill.utils.download_asset {name} with its Python"
        ) from None
    except RuntimeError as error:
        if "rendering device" in str(error):
            raise ValueError(
                "SAPIEN cannot load models on a machine without Vulkan: install a GPU driver and libvulkan1"
            ) from None
        raise
    if not hasattr(envs[0].unwrapped.single_action_space, "low"):
        raise ValueError("it has several robots with separate actions, and policies here control only one")
    return Batches(envs)
