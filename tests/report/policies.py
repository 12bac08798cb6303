"""Policies that nobody trained."""

from __future__ import annotations

import torch

from openeureka.training.policy import Policy


def policy(observations: int, actions: int, hidden: tuple[int, ...]) -> Policy:
    """Random weights, large enough that both clamps act, and statistics far from zero and one."""
    generator = torch.Generator().manual_seed(0)

    def rand(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator)

    sizes = (observations, *hidden)
    tensors = {f"w{i}": rand(a, b) / a**0.5 for i, (a, b) in enumerate(zip(sizes, hidden, strict=False))}
    tensors |= {f"b{i}": rand(1, size) for i, size in enumerate(hidden)}
    tensors |= {"head_w": rand(hidden[-1], actions + 1), "head_b": rand(1, actions + 1), "log_std": rand(1, actions)}
    tensors |= {"observation_mean": 3 * rand(1, observations), "observation_var": 0.1 + 4 * rand(1, observations) ** 2}
    return Policy("toy", tensors)
