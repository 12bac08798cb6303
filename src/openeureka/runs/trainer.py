"""The trainer that a command's settings ask for."""

from __future__ import annotations

from pathlib import Path

from ..config import RunConfig
from ..executors import EXECUTORS
from ..store import StageFiles
from ..tasks import curriculum
from ..training.curriculum import CurriculumTrainer
from ..types import Trainer


def trainer_of(config: RunConfig, directory: Path) -> Trainer:
    """Trains the task alone, or through the stages of a curriculum, kept in the directory.

    Raises:
        ConfigError: for an executor, a device or a curriculum that does not exist or does not fit.
    """
    options: dict[str, object] = {
        "device": config.device,
        "threads": config.threads,
        "snapshots": directory / "snapshots",
    }
    options |= {"address": config.address} if config.address else {}
    trainer: Trainer = EXECUTORS.make(config.executor, **options)
    if not config.curriculum:
        return trainer
    stages = curriculum.find(config.env, config.curriculum)
    return CurriculumTrainer(trainer, stages, StageFiles(directory))
