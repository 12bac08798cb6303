"""States of lanes as bytes: what a paused lane or a stopped training leaves behind.

The classes that own a state define what it holds (`lane_state`), and how those of several lanes are joined
(`load_lanes`).
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

State = dict[str, Any]
"""The state of one lane: nested dictionaries and lists of tensors, numbers and text."""


def save(state: State) -> bytes:
    """The state in PyTorch's format; it may hold nothing but tensors, numbers and text."""
    file = io.BytesIO()
    torch.save(state, file)
    return file.getvalue()


def load(data: bytes, device: torch.device) -> State:
    """Inverse of `save`. Forged data cannot run code."""
    return torch.load(io.BytesIO(data), map_location=device, weights_only=True)


def kind(state: State) -> str:
    """Kind of device that a state was saved on. An older version did not store it, and never ran on a GPU."""
    return state.get("device", "cpu")


def joined(states: Sequence[State]) -> State:
    """One state of several lanes: tensors and lists are concatenated at every depth, and numbers are equal in all."""

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
