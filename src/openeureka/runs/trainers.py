"""The trainer of a run's lanes, made from its settings."""

from __future__ import annotations

from pathlib import Path

from ..config import RunConfig
from ..errors import ConfigError
from ..executors import EXECUTORS
from ..executors.local import devices
from ..store import StageFiles
from ..tasks import curriculum, ranges
from ..tasks.registry import get
from ..tasks.task import Stage
from ..training.curriculum import CurriculumTrainer, shares
from ..types import Trainer

MOST_EPOCHS = 100_000
"""Most epochs of a training: its curves are stored whole, in a row of at most 64 MiB."""


def trainer_of(config: RunConfig, directory: Path) -> Trainer:
    """A trainer of the task, or of the stages of a curriculum, which it stores in the directory. Raises ConfigError for
    an executor, a device, a curriculum or ranges that do not exist or do not fit."""
    stages = expect_fit(config)
    cluster = {"address": config.address} if config.address else {}
    trainer: Trainer = EXECUTORS.make(  # last: it may start processes
        config.executor, device=config.device, threads=config.threads, snapshots=directory / "snapshots", **cluster
    )
    return CurriculumTrainer(trainer, stages, StageFiles(directory)) if stages else trainer


def expect_fit(config: RunConfig) -> tuple[Stage, ...]:
    """Refuse what `trainer_of` refuses, except what only an executor at work knows; starts nothing.

    Returns:
        The stages of the curriculum, if there is one.
    """
    if config.address and config.executor == "local":
        raise ConfigError(
            "`address=` names a Ray cluster; add executor=ray, or write `address=` with nothing after it."
        )
    expect_storable(config, config.env, config.steps, "steps=")
    if config.polish_steps:
        expect_storable(config, config.env, config.polish_steps, "polish_steps=")
    ranges.find(config.env, config.randomise)  # refuses what does not fit
    if config.observe != "all" and not (task := get(config.env)).unmeasured:
        raise ConfigError(f"Everything that `{task.env}` observes counts as measurable; leave observe=measurable out.")
    stages = _stages(config) if config.curriculum else ()
    EXECUTORS.find(config.executor)
    if config.executor == "local":
        devices(config.device)
    return stages


def _stages(config: RunConfig) -> tuple[Stage, ...]:
    """The stages of the curriculum. Raises ConfigError where they cannot train with the other settings."""
    stages = curriculum.find(config.env, config.curriculum)
    if config.observe != "all" and len({get(stage.env).unseen("measurable") for stage in stages}) > 1:
        raise ConfigError(
            f"The stages of `{config.curriculum}` differ in what is measurable. Leave observe=measurable out, or give "
            "all their tasks the same `unmeasured`."
        )
    for stage, steps in zip(stages, shares(stages, config.steps), strict=True):
        expect_storable(config, stage.env, steps, "steps= or `steps:` of its stage")
    return stages


def expect_storable(config: RunConfig, env: str, steps: int, said: str) -> None:
    """Raises ConfigError for more epochs than `MOST_EPOCHS`: a result has a value of each curve and epoch."""
    recipe = get(env).recipe
    steps, worlds = steps or recipe.env_steps, config.worlds or recipe.worlds
    epochs = steps // (worlds * recipe.horizon)
    if epochs > MOST_EPOCHS:
        raise ConfigError(
            f"{steps:,} steps in {worlds} worlds are {epochs:,} epochs, but a training has at most {MOST_EPOCHS:,}; "
            f"use more worlds= or fewer {said}."
        )
