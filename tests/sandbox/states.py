"""Recorded states for the table that the hostile programs read."""

from __future__ import annotations

import torch

from openeureka.reward.states import Recorded


def recorded() -> Recorded:
    """256 worlds. The first 8 are at the origin, as after a reset."""
    generator = torch.Generator().manual_seed(0)
    drawn = {"pos": (256, 3), "vel": (256, 3), "phase": (256,)}
    states = {name: torch.randn(shape, generator=generator) for name, shape in drawn.items()}
    states["pos"][:8] = 0.0
    return {**states, "dt": 0.02}
