"""Trains rewards again, with seeds that had no part in choosing any of them."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from intervals import ends
from records import Record

import openeureka
from openeureka.config import RunConfig
from openeureka.method.given import seeds
from openeureka.method.seeds import unused_seed
from openeureka.stats import difference
from openeureka.tasks import registry
from openeureka.training.evaluate import begin_alike


@dataclass(frozen=True)
class Trained:
    """What rewards reached with other seeds."""

    seeds: list[int]
    scores: list[list[float]]
    """Held-out F: a list per reward, with a value per seed."""
    noisy: bool
    """Whether policies played with the noise of training, as they do where all episodes begin alike."""


def several(text: str) -> int:
    """How many seeds a word of the command line asks for.

    Raises:
        ArgumentTypeError: below two, which have no spread.
    """
    if not text.isdecimal() or int(text) < 2:
        raise ArgumentTypeError(f"{text} is no number of seeds from 2 on: one has no spread")
    return int(text)


def trained(config: RunConfig, rewards: Sequence[str], directory: Path, count: int) -> Trained:
    """Train them side by side as the run did, or go on with it.

    Args:
        config: of the run in which one of them was chosen.
        rewards: names of built-in ones, or programs.
        directory: of the new run.
        count: seeds of each; from two on.

    Raises:
        SystemExit: as `held_out` does, and where the run's policies played without the noise that the task asks for.
    """
    run = openeureka.train(
        config.env,
        list(rewards),
        dir=directory,
        seed=unused_seed(config),
        seeds=count,
        steps=config.steps,
        worlds=config.worlds,
        device=config.device,
    )
    scores = list(held_out(run, count).values())
    if run.view.noisy != noisy(config.env):
        raise SystemExit(f"{directory} holds scores without noise: remove it, and the seeds train again.")
    return Trained(list(seeds(run.config)), scores, run.view.noisy)


@cache
def noisy(env: str) -> bool:
    """Whether policies of a task play with the noise of training."""
    simulation = registry.make(env, worlds=2)
    simulation.reset()
    return begin_alike(simulation)


def as_today(kept: Record, env: str) -> bool:
    """Whether the policies of kept scores played as policies do today."""
    return kept.get("noisy", False) == noisy(env)


def reusable(kept: Record, env: str, count: int) -> bool:
    """Whether kept scores are those that so many seeds would reach today, each trained for as many steps as the row."""
    return len(kept.get("seeds", ())) == count and "steps" not in kept and as_today(kept, env)


def held_out(run: openeureka.Run, count: int) -> dict[str, list[float]]:
    """Held-out F of each given reward by its name, a value of each of so many seeds.

    Raises:
        SystemExit: where a training has no score: a mean of those that have one would flatter the reward.
    """
    given = run.view.given
    for name, own in given.items():
        if len(own.scores) < count:
            unscored = f"{count - len(own.scores)} of {count} trainings of {name} have no held-out score"
            raise SystemExit(f"{unscored}, so nothing is compared. `eureka report {run.directory}` says why.")
    return {name: list(own.scores) for name, own in given.items()}


def between(first: Sequence[float], second: Sequence[float], *, claims: int = 1) -> list[float]:
    """The difference of the means, second less first, and the ends of its 95 % interval.

    Args:
        claims: how many such intervals are to hold together (Bonferroni).
    """
    found = ends(difference(second, first, claims=claims))
    assert found is not None
    return found
