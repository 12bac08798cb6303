"""A trained policy as a function of observations."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import ArrayLike

from ..training.policy import Player, Policy


@dataclass(frozen=True, slots=True)
class TrainedPolicy:
    """Called with observations (O,) or (N, O) it returns float32 actions (A,) or (N, A) in [-1, 1], without noise."""

    env: str
    """The task it was trained on."""
    observations: int
    """O."""
    actions: int
    """A."""
    _player: Player = field(repr=False, compare=False)

    @classmethod
    def of(cls, data: bytes) -> TrainedPolicy:
        """From a safetensors file. Raises RewardFileError for anything else."""
        policy = Policy.from_bytes(data)
        policy.expect()
        return cls(policy.env, policy.observations, policy.actions, Player([policy]))

    def __call__(self, observations: ArrayLike) -> np.ndarray:
        seen = np.asarray(observations, dtype=np.float32)
        if seen.ndim not in (1, 2) or seen.shape[-1] != self.observations:
            raise ValueError(f"observations are ({self.observations},) or (N, {self.observations}), not {seen.shape}")
        actions = self._player(torch.from_numpy(np.atleast_2d(seen).copy())).numpy()
        return actions[0] if seen.ndim == 1 else actions
