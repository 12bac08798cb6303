"""One world of an environment that draws itself, under a policy: what a video shows of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..errors import EurekaError
from ..tasks import registry
from .stage import Play


class NothingDrawn(EurekaError):
    """The environment has no pictures."""


def draws_itself(env: str) -> bool:
    """Whether MuJoCo has nothing to show of a task."""
    return registry.get(env).draws_itself


class Screen(Play):
    """Pictures as the environment makes them; raises NothingDrawn where it makes none."""

    def __init__(self, env: str, agent: str | bytes, seed: int) -> None:
        super().__init__(env, agent, seed)
        self._env = env

    @contextmanager
    def painter(self, width: int, height: int) -> Iterator[Any]:
        """A function that draws what is now, (height, width, 3) uint8."""
        worlds: Any = self._simulation.sim

        def paint() -> np.ndarray:
            picture = worlds.picture(0)
            if picture is None:
                raise NothingDrawn(f"`{self._env}` draws no pictures of itself.")
            return fitted(picture, width, height)

        yield paint


def fitted(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """A picture (h, w, 3) as large as fits into (height, width, 3), black around it, of nearest pixels."""
    scale = min(width / picture.shape[1], height / picture.shape[0])
    tall, wide = (max(1, int(size * scale)) for size in picture.shape[:2])
    rows, columns = (
        (np.arange(size) * given // size) for size, given in zip((tall, wide), picture.shape[:2], strict=True)
    )
    canvas = np.zeros((height, width, 3), np.uint8)
    top, left = (height - tall) // 2, (width - wide) // 2
    canvas[top : top + tall, left : left + wide] = picture[rows][:, columns]
    return canvas
