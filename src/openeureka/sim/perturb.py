"""Worlds that are a little heavier or more slippery than the model says."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from ..types import Dynamics
from .base import Simulator

FIELDS = {"mass": ("body_mass", "body_inertia"), "friction": ("geom_friction",)}
"""MjModel fields that each factor of `Dynamics` scales. Inertia goes with mass, as if the material were denser."""


def perturb(sim: Simulator, lanes: Sequence[Dynamics]) -> None:
    """Scale the models of L lanes of equally many worlds; call it once, before the first reset.

    A field that no lane changes stays shared by all worlds.
    """
    for name, fields in FIELDS.items():
        factors = torch.tensor([getattr(dynamics, name) for dynamics in lanes], device=sim.device)
        if bool((factors == 1.0).all()):
            continue
        each = factors.repeat_interleave(sim.num_worlds // len(lanes))
        for field in fields:
            values = sim.expand(field)
            values *= each.view(-1, *[1] * (values.dim() - 1))
