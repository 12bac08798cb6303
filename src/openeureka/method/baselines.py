"""What the human and the sparse reward of each task reach, measured beforehand by benchmarks/baselines.py."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from ..config import NO_RANGES, RunConfig
from ..errors import ConfigError
from ..score import SeedScores, rank
from ..stats import mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Both ends of the scale for one task, measured beforehand."""

    human: SeedScores
    sparse: SeedScores
    env_steps: int
    worlds: int
    device: str
    date: str

    def sentence(self) -> str:
        """How the numbers were measured, in a sentence."""
        seeds = len(self.human.training)
        size = f"{self.env_steps:,} steps in {self.worlds} worlds, {seeds} seed{'s' if seeds != 1 else ''}"
        return f"The human and the sparse reward were measured beforehand: {size}, on {self.device}, {self.date}."


def known(env: str, *, played: bool = False) -> Baselines | None:
    """Measured baselines of a task that openeureka ships; None for tasks it does not know.

    Args:
        played: whether to take held-out F of the policies at the peak of F or at that of their own reward, whichever
            play better on average, as a run does; else of those at the peak of F.
    """
    entry = _shipped().get(env)
    if entry is None:
        return None

    def scored(name: str) -> SeedScores:
        held_out: Mapping[str, list[float]] = entry[name]["held_out"]
        peak = max(held_out, key=lambda peak: rank(mean(held_out[peak]))) if played else "fitness"
        return SeedScores(training=tuple(entry[name]["training"]), held_out=tuple(held_out[peak]))

    ends: dict[str, Any] = {"human": scored("human"), "sparse": scored("sparse")}
    return Baselines(**{**entry, **ends})


def chosen(config: RunConfig) -> Baselines | None:
    """The baselines that `baselines=known` refers to; None where the run trains both rewards itself.

    Raises:
        ConfigError: when they were not measured for this task as the run trains it.
    """
    if config.baselines != "known":
        return None
    found = measured(config)
    if found is None or not (found.human.training and found.sparse.training):
        what = f"{config.env}{_apart(config)}"
        raise ConfigError(f"The baselines of {what} were not measured beforehand; use baselines=train.")
    return found


def measured(config: RunConfig) -> Baselines | None:
    """The shipped baselines of a task; None if it has none, or the run's settings differ from those measured."""
    return known(config.env, played=config.search != "eureka") if not _apart(config) else None


def _apart(config: RunConfig) -> str:
    """The first setting of a run that no baseline was measured with, as ` with NAME`; empty where there is none."""
    unlike = (
        ("a curriculum", bool(config.curriculum)),
        ("randomise=", config.randomise != NO_RANGES),
        ("observe=measurable", config.observe != "all"),
    )
    return next((f" with {name}" for name, differs in unlike if differs), "")


@cache
def _shipped() -> Mapping[str, Any]:
    return json.loads(files("openeureka.suite").joinpath("baselines.json").read_text())
