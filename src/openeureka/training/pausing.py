"""What a paused lane, or a stopped training, leaves behind: states of lanes as bytes.

What is in a state, and how those of several lanes become one, its owners say (`lane_state`, `load_lanes`).
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

State = dict[str, Any]
"""Of one lane, with an axis of length 1: nested dictionaries and lists of tensors, numbers and text."""


def save(state: State) -> bytes:
    """Tensors, numbers and text alone, as PyTorch writes them."""
    file = io.BytesIO()
    torch.save(state, file)
    return file.getvalue()


def load(data: bytes, device: torch.device) -> State:
    """Inverse of `save`. What anybody else made of it can run nothing."""
    return torch.load(io.BytesIO(data), map_location=device, weights_only=True)


def kind(state: State) -> str:
    """Of the device that a state was left on; an older version, which did not say, never ran on a GPU."""
    return state.get("device", "cpu")


def joined(states: Sequence[State]) -> State:
    """Tensors of all lanes one after the other, and lists, at every depth; of numbers, which are equal, the first."""

    def of(values: Sequence[Any]) -> Any:
        first = values[0]
        if isinstance(first, Tensor):
            return torch.cat(list(values))
        if isinstance(first, dict):
            return joined(values)
        if isinstance(first, tuple):
            return tuple(of(each) for each in zip(*values, strict=True))
        if isinstance(first, list):
            return [value for own in values for value in own]
        return first

    return {name: of([state[name] for state in states]) for name in states[0]}
