"""The trainer that a command's settings ask for."""

from __future__ import annotations

from pathlib import Path

from ..config import RunConfig
from ..store import StageFiles
from ..tasks import curriculum
from ..training.curriculum import CurriculumTrainer
from ..training.executor import PopulationTrainer
from ..types import Trainer


def trainer_of(config: RunConfig, directory: Path) -> Trainer:
    """Trains the task alone, or through the stages of a curriculum, kept in the directory.

    Raises:
        ConfigError: for a device or a curriculum that does not exist or does not fit.
    """
    trainer = PopulationTrainer(device=config.device, threads=config.threads, snapshots=directory / "snapshots")
    if not config.curriculum:
        return trainer
    stages = curriculum.find(config.env, config.curriculum)
    return CurriculumTrainer(trainer, stages, StageFiles(directory))
