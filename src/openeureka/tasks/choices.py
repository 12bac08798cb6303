"""Discrete actions: one option of each choice, as ones and zeros in an action of the width of all options."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import one_hot


def indices(preferences: Tensor, choices: Sequence[int]) -> Tensor:
    """The most preferred option of each choice (..., C), int64; the first of equally preferred ones.

    Args:
        preferences: (..., sum(choices)).
        choices: options of each choice.
    """
    return torch.stack([part.argmax(-1) for part in preferences.split(list(choices), dim=-1)], dim=-1)


def chosen(preferences: Tensor, choices: Sequence[int]) -> Tensor:
    """The most preferred options as ones among zeros, of the shape of the preferences (..., sum(choices))."""
    picked = indices(preferences, choices).unbind(-1)
    parts = [one_hot(index, options) for index, options in zip(picked, choices, strict=True)]
    return torch.cat(parts, dim=-1).to(preferences.dtype)
