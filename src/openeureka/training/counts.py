"""Visits of how far episodes have come, and what rare ones pay.

The idea is that of progress counts (arXiv 2410.09187): a program says coarsely how far an episode has come, and a
policy is paid for being where the ones before it have hardly been, by the inverse root of visits (arXiv 1606.01868).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

VALUES = 3
"""Progress values of a program that count, the first ones."""
BINS = 10
"""Of each value. Three values make 1,000 bins: an even share of a training of a million steps visits each a thousand
times, and pays 3 % of a first visit at its end. With finer bins everything would stay new."""


class ProgressCounts:
    """A table of visits for each of L lanes; no lane knows of another's.

    Attributes:
        visits: (L, 1000) integers: a sum of them is exact and does not depend on the order, on a GPU neither.
    """

    def __init__(self, lanes: int, device: torch.device) -> None:
        self.visits = torch.zeros(lanes, BINS**VALUES, dtype=torch.int64, device=device)
        self._places = BINS ** torch.arange(VALUES, device=device)[:, None]

    def __call__(self, values: Tensor, counted: Tensor) -> Tensor:
        """Count a step of n worlds, and say what it pays: (L, n), 1 / sqrt(visits of the bin), this step among them.

        Args:
            values: (L, 3, n), clamped to 0..1. A world in which one is not finite visits nothing, and is paid nothing.
            counted: (L, n), false for worlds that visit nothing either.
        """
        counted = counted & torch.isfinite(values).all(1)
        steps = (values.nan_to_num(0.0).clamp(0.0, 1.0) * BINS).long().clamp(max=BINS - 1)
        bins = (steps * self._places).sum(1)
        self.visits.scatter_add_(1, bins, counted.long())
        return counted / self.visits.gather(1, bins).clamp(min=1).sqrt()

    def state_dict(self) -> dict[str, Any]:
        return {"visits": self.visits}

    def load_state_dict(self, saved: Mapping[str, Any]) -> None:
        self.visits = saved["visits"]
