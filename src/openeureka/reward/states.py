"""Recorded states of a task: what a reward is judged on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from ..types import StateSpec

Recorded = Mapping[str, Tensor | float | int]
"""Per-world variables (M, *shape), constants and Python numbers, by name."""


def world_count(recorded: Recorded, spec: StateSpec) -> int:
    known = spec.per_world
    return next(value.shape[0] for name, value in recorded.items() if name in known and isinstance(value, Tensor))


def take(recorded: Recorded, spec: StateSpec, worlds: Sequence[int] | Tensor) -> dict[str, Any]:
    """Copies of the states of some worlds. Indices beyond the recorded worlds wrap around."""
    index = torch.as_tensor(worlds) % world_count(recorded, spec)
    values: dict[str, Any] = {}
    for name, value in recorded.items():
        if isinstance(value, Tensor):
            value = value[index] if name in spec.per_world else value.clone()
        values[name] = value
    values.update({variable.name: len(worlds) for variable in spec.variables if variable.kind == "num_envs"})
    return values


def only(recorded: Recorded, spec: StateSpec, names: Sequence[str]) -> Recorded:
    """The named variables, plus one per-world variable, from which the number of worlds is read."""
    world = spec.per_world[0]
    return {name: value for name, value in recorded.items() if name in names or name == world}
