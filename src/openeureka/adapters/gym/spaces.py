"""Observations of any space as one vector with named parts; a policy's actions as an environment's space wants them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from gymnasium import Space, spaces
from torch import Tensor

from ...errors import TaskError
from ...tasks.choices import indices

PICTURE = 32
"""Rows and columns of the smallest picture."""
UNBOUNDED = 1e10
"""A bound of this size or more counts as none. dm_control writes this number for no bound; others write the largest."""


@dataclass(frozen=True, slots=True)
class Part:
    """One array of an observation."""

    path: tuple[str | int, ...]
    """Keys that lead to it; none where the whole observation is one array."""
    kind: str
    """Class of its space."""
    shape: tuple[int, ...]
    """In the vector, where whole numbers are one-hot."""
    counts: tuple[int, ...] = ()
    """How many values each whole number has; empty for any other array."""
    starts: tuple[int, ...] = ()
    """The first value of each whole number."""

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=int))

    @property
    def columns(self) -> list[str]:
        """What each column is."""
        if not self.counts:
            return [f"column {i} of the observation" for i in range(self.size)]
        numbers = enumerate(zip(self.starts, self.counts, strict=True), start=1)
        seen = [(first + i, place) for place, (first, count) in numbers for i in range(count)]
        alone = self.kind == "Discrete"
        return [f"1 where it observes {value}{'' if alone else f' as number {place}'}, else 0" for value, place in seen]

    def of(self, observation: Any) -> np.ndarray:
        """The array's value in an observation, or in a batch of them."""
        for key in self.path:
            observation = observation[key]
        return np.asarray(observation)

    def rows(self, observations: Any) -> np.ndarray:
        """(N, size) float32, of the observations of N worlds as a vector environment batches them."""
        array = self.of(observations)
        array = array.reshape(len(array), -1)
        return _ones(array - self.starts, self.counts) if self.counts else array.astype(np.float32)


def _ones(values: np.ndarray, counts: Sequence[int]) -> np.ndarray:
    """(N, sum(counts)) one-hot form of whole numbers (N, len(counts)). Raises ValueError for one out of range."""
    for i, count in enumerate(counts):
        if not ((values[:, i] >= 0) & (values[:, i] < count)).all():
            raise ValueError(f"it observes a number outside 0 to {count - 1}, counted from the `start` of its space")
    ones = np.zeros((len(values), sum(counts)), np.float32)
    np.put_along_axis(ones, values.astype(np.int64) + np.cumsum([0, *counts[:-1]]), 1.0, axis=1)
    return ones


def parts(space: Space[Any], env: str) -> tuple[Part, ...]:
    """The arrays of an observation, without its texts.

    Raises:
        TaskError: where one is a picture or has no fixed size, or where there is no array.
    """
    found = tuple(_parts(space, (), env))
    if not found:
        raise TaskError(f"`{env}` observes nothing but text; wrap it so that it observes numbers.")
    return found


def _parts(space: Space[Any], path: tuple[str | int, ...], env: str) -> Iterator[Part]:
    if isinstance(space, spaces.Dict):
        for key, inner in space.spaces.items():
            yield from _parts(inner, (*path, key), env)
    elif isinstance(space, spaces.Tuple):
        for number, inner in enumerate(space.spaces):
            yield from _parts(inner, (*path, number), env)
    elif isinstance(space, spaces.Discrete | spaces.MultiDiscrete):
        counts, starts = _options(space)
        yield Part(path, type(space).__name__, (sum(counts),), counts, starts)
    elif isinstance(space, spaces.Box) and _is_picture(space):
        raise TaskError(f"`{env}` observes pictures, which no policy here can read; wrap it to observe numbers.")
    elif isinstance(space, spaces.Box | spaces.MultiBinary):
        yield Part(path, type(space).__name__, space.shape or (1,))
    elif space.dtype is None or space.dtype.kind != "U":  # texts, whatever class they are of
        raise TaskError(
            f"`{env}` observes a {type(space).__name__}, which has no fixed size; wrap it to observe a Box."
        )


def _options(space: Space[Any]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """How many options each choice of a space has, and the number of the first one; nothing for other spaces."""
    if isinstance(space, spaces.Discrete):
        return (int(space.n),), (int(space.start),)
    if isinstance(space, spaces.MultiDiscrete):
        return tuple(space.nvec.reshape(-1).tolist()), tuple(space.start.reshape(-1).tolist())
    bits = int(np.prod(space.shape)) if isinstance(space, spaces.MultiBinary) else 0
    return (2,) * bits, (0,) * bits


def _is_picture(space: spaces.Box) -> bool:
    """Whether a space holds bytes in rows and columns, more of them than an agent sees of a grid world."""
    return space.dtype == np.uint8 and len(space.shape) >= 2 and sorted(space.shape)[-2] >= PICTURE


@dataclass(frozen=True, slots=True)
class Actions:
    """What a policy's actions mean to an environment."""

    space: Space[Any]
    size: int
    choices: tuple[int, ...] = ()
    """Number of options of each choice; empty for a Box."""
    starts: tuple[int, ...] = ()
    """Number of the first option of each choice."""

    def taken(self, actions: Tensor) -> np.ndarray:
        """Actions (N, size) as the environment takes them, with a leading axis N.

        A number of a Box without bounds is the action itself. With one bound it is shifted, if needed, so that an
        action of 0 is at least 1 inside the bound: a policy begins near 0 and would be stuck at the bound.
        """
        space = self.space
        if isinstance(space, spaces.Box):
            low, high, middle, half = _range(space)
            scaled = np.clip(middle + half * actions.double().numpy(), low, high)
            scaled = np.rint(scaled) if space.dtype.kind in "iu" else scaled
            return scaled.astype(space.dtype).reshape(-1, *space.shape)
        picked = indices(actions, self.choices).numpy() + self.starts
        return picked.reshape(-1, *(space.shape or ())).astype(space.dtype)

    def seen(self, actions: Tensor) -> Tensor:
        """Actions (N, size) as rewards see them: what the environment took, in [-1, 1]. In a Box of whole numbers they
        are rounded; where only one value is possible, they are 0."""
        if not isinstance(self.space, spaces.Box):
            return actions
        *_, middle, half = _range(self.space)
        if self.space.dtype.kind not in "iu":
            return actions if half.all() else actions.where(torch.from_numpy(half > 0.0), 0.0)
        taken = self.taken(actions.nan_to_num()).reshape(len(actions), -1)
        scaled = (taken - middle) / np.where(half > 0.0, half, 1.0)
        return torch.from_numpy(np.clip(scaled, -1.0, 1.0).astype(np.float32))

    def told(self) -> dict[str, list[float]]:
        """For a Box, what actions of -1 and 1 stand for; for choices, how many options each has, and the first one."""
        if not self.choices:
            low, high = self.taken(torch.tensor([[-1.0], [1.0]]).expand(2, self.size)).reshape(2, -1).tolist()
            return {"action_low": low, "action_high": high}
        return {"action_options": list(self.choices), "action_first": list(self.starts)}


def _range(space: spaces.Box) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(size,) each: lower and upper bounds, what an action of 0 stands for, and how far from that an action of 1 is."""
    low, high = (side.reshape(-1).astype(np.float64) for side in (space.low, space.high))
    low = np.where(np.abs(low) < UNBOUNDED, low, -np.inf)
    high = np.where(np.abs(high) < UNBOUNDED, high, np.inf)
    bounded = np.isfinite(low) & np.isfinite(high)
    with np.errstate(invalid="ignore"):  # from sides without a bound, which are not used
        middle = np.where(bounded, (low + high) / 2, np.clip(0.0, low + 1.0, high - 1.0))
        half = np.where(bounded, (high - low) / 2, 1.0)
    return low, high, middle, half


def actions(space: Space[Any], env: str) -> Actions:
    """Raises TaskError for a space that no policy here can act in."""
    if isinstance(space, spaces.Box):
        return Actions(space, int(np.prod(space.shape, dtype=int)))
    choices, starts = _options(space)
    if not choices:
        raise TaskError(
            f"`{env}` has actions of the space {type(space).__name__}; policies here know Box, Discrete, MultiDiscrete "
            "and MultiBinary: wrap the environment."
        )
    return Actions(space, sum(choices), choices, starts)
