"""Held-out score: deterministic actions on episodes no training saw."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import torch
from torch import Tensor

from ..tasks import registry
from ..types import Evaluation
from .policy import Player, Policy

HELD_OUT_SEED = 1 << 32
"""Added to the seed, so that no start state of training is drawn again."""
WORLDS = 256
LOOK = 32
"""[steps]"""


def evaluate(
    env: str, policies: Mapping[str, bytes], *, seed: int, worlds: int = WORLDS, device: str = "cpu", threads: int = 0
) -> list[Evaluation]:
    """Score every policy of one task side by side, on the same start states.

    Each world plays one episode; what it does after a reset counts for nothing. F is averaged as the task defines it,
    over those episodes.

    Args:
        policies: job id to safetensors bytes; equal network shapes.
    """
    if not policies:
        return []
    lanes = len(policies)
    simulation = registry.make(
        env, worlds=worlds, lane_seeds=[seed + HELD_OUT_SEED] * lanes, device=device, threads=threads
    )
    play = Player([Policy.from_bytes(data) for data in policies.values()], simulation.sim.device)
    observation = simulation.reset()
    running = torch.ones(simulation.num_worlds, dtype=torch.bool, device=observation.device)
    total = torch.zeros(3, lanes, dtype=torch.float64, device=observation.device)

    def per_lane(x: Tensor) -> Tensor:
        return x.double().view(lanes, worlds).sum(1)

    for number in itertools.count():
        # On a GPU the host looks now and then whether any world still plays: looking waits for the device.
        if number % (LOOK if simulation.masked else 1) == 0 and not bool(running.any()):
            break
        step = simulation.step(play(observation))
        value, weight = step.score.value, step.score.weight * running
        total += torch.stack([per_lane(x) for x in (value * weight, weight, running)])
        running &= ~step.done
        observation = step.observation
    simulation.check()
    return [
        Evaluation(
            job=job,
            fitness=value / weight if weight else None,
            episode_length=steps / worlds,
            episodes=worlds,
        )
        for job, (value, weight, steps) in zip(policies, total.T.tolist(), strict=True)
    ]
