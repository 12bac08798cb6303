"""A run directory as a search leaves it, made in milliseconds from what a scripted model says."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from loop.alone import run

from openeureka import strategies
from openeureka.config import RunConfig
from openeureka.events import Tell, nobody
from openeureka.llm.client import LanguageModel
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer
from openeureka.types import Trainer


def search_in(
    directory: Path,
    script: Sequence[str],
    *,
    model: LanguageModel | None = None,
    trainer: Trainer | None = None,
    tell: Tell = nobody,
    **settings: object,
) -> Path:
    """Run a toy search of two slots. An exception of the model or the trainer ends it there."""
    config = RunConfig(**{"env": "toy", "sample": 2, "iteration": 1, "refill": 0, "seeds": 1, **settings})  # type: ignore[arg-type]
    with Store.open(directory, config) as store:
        model, trainer = model or ScriptedModel(script), trainer or ToyTrainer()
        run(config, store, model, ToyChecker(), trainer, TOY, strategies.make(config), tell)
    return directory
