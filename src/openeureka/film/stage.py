"""One world of a task under a policy, drawn by MuJoCo or by its environment itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
import torch
from PIL import Image, ImageOps
from torch import Tensor

from ..errors import EurekaError
from ..tasks import registry
from ..training.policy import Player, Policy
from .camera import ASPECT, Camera
from .looks import decorated, place_ghosts

Agent = Callable[[Tensor], Tensor]


class Play:
    """One world under a policy; `step` plays on, across episodes.

    Args:
        agent: `random`, `zero` or a policy's safetensors bytes.

    Attributes:
        dt: [s] of a step.

    Raises:
        RewardFileError: when the policy is for another task.
    """

    def __init__(self, env: str, agent: str | bytes, seed: int) -> None:
        self._agent = _agent(env, agent, seed)
        self._simulation = registry.make(env, worlds=1, lane_seeds=(seed,), threads=1)
        self._simulation.scored = False  # a task can be watched before its F is written
        self._observation = self._simulation.reset()
        self.dt = self._simulation.task.control_dt

    def step(self) -> None:
        """One control step."""
        self._observation = self._simulation.step(self._agent(self._observation)).observation


class Stage(Play):
    """A world that MuJoCo draws. `data` is a copy of its present state, which may be drawn at any time.

    Args:
        aspect: width of the pictures over their height.
    """

    def __init__(self, env: str, agent: str | bytes, seed: int, aspect: float = ASPECT) -> None:
        super().__init__(env, agent, seed)
        task = self._simulation.task
        self.model = decorated(type(task), task.ghosts())
        self.data = mujoco.MjData(self.model)
        self._copy()
        self.director = Camera(self.model, self.data, task.view, aspect)
        self.camera = self.director.eye

    def step(self) -> None:
        super().step()
        self._copy()
        self.director.follow(self.data, self.dt)
        self.data.light_xpos[0] += self.camera.lookat - self.model.stat.center  # shadows are drawn only around the sun

    @contextmanager
    def painter(self, width: int, height: int) -> Iterator[Callable[[], np.ndarray]]:
        """A function that draws the present state, (height, width, 3) uint8."""
        seen = self.model.vis.global_
        seen.offwidth, seen.offheight = max(width, seen.offwidth), max(height, seen.offheight)
        with mujoco.Renderer(self.model, height, width) as renderer:

            def paint() -> np.ndarray:
                renderer.update_scene(self.data, self.camera)
                return renderer.render()

            yield paint

    def _copy(self) -> None:
        _, data = self._simulation.sim.snapshot(0)
        own = slice(len(data.mocap_pos))
        self.data.qpos[:], self.data.mocap_pos[own], self.data.mocap_quat[own] = (
            data.qpos,
            data.mocap_pos,
            data.mocap_quat,
        )
        place_ghosts(self.model, self.data, self._simulation.task.ghosts())
        mujoco.mj_forward(self.model, self.data)


def _agent(env: str, kind: str | bytes, seed: int) -> Agent:
    task = registry.get(env)
    actions = task.num_actions
    if isinstance(kind, bytes):
        policy = Policy.from_bytes(kind)
        policy.expect(task.num_observations, actions)
        return Player([policy])
    if kind == "random":
        generator = torch.Generator().manual_seed(seed)
        return lambda observation: torch.rand(len(observation), actions, generator=generator) * 2 - 1
    return lambda observation: torch.zeros(len(observation), actions)


class NothingDrawn(EurekaError):
    """The environment has no pictures."""


def draws_itself(env: str) -> bool:
    """Whether a task's environment makes its own pictures, as MuJoCo has nothing to show of it."""
    return registry.get(env).steps_itself


class Screen(Play):
    """Pictures as the environment makes them; raises NothingDrawn where it makes none."""

    @contextmanager
    def painter(self, width: int, height: int) -> Iterator[Callable[[], np.ndarray]]:
        """A function that draws the present state, (height, width, 3) uint8, with black around it."""
        worlds: Any = self._simulation.sim

        def paint() -> np.ndarray:
            picture = worlds.picture(0)
            if picture is None:
                raise NothingDrawn(f"`{self._simulation.task.env}` does not render pictures.")
            drawn = Image.fromarray(picture).convert("RGB")  # some have a fourth channel, for opacity
            return np.array(ImageOps.pad(drawn, (width, height), Image.Resampling.NEAREST))

        yield paint
