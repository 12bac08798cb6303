"""A bench of pure functions. Each request and each training leaves a line in a file, which outlives the process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from openeureka.config import RunConfig
from openeureka.errors import ModelError
from openeureka.runs import compose
from openeureka.testing.scripted import ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import LaneSpec, Prompt, Reply, TrainBudget, TrainingProgress, TrainingResult

SCRIPTS = {"strong": [reply(8), reply(12)], "weak": [reply(6), reply(6)]}
"""Replies by model. Both rewards of the weak model are the same graph."""
PLAN = {
    "tasks": ["cartpole"],
    "seeds": [0, 10],
    "settings": {"sample": 2, "iteration": 1, "seeds": 2, "refill": 0, "video": "none"},
    "arms": {"full": {"model": "strong"}, "weaker": {"model": "weak"}},
}


@dataclass
class MeteredModel(ScriptedModel):
    meter: Path = field(kw_only=True)

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        for _ in range(n):
            with self.meter.open("a") as meter:
                meter.write(f"{self.name} {seed}\n")
            yield from super().sample(prompt, n=1, seed=seed)


@dataclass
class MeteredTrainer(ToyTrainer):
    meter: Path = field(kw_only=True)
    cell: str = field(kw_only=True)

    def train(
        self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        for event in super().train(env, lanes, budget):
            if isinstance(event, TrainingResult):
                with self.meter.open("a") as meter:
                    meter.write(f"{self.cell} {event.lane}\n")
            yield event


def play(monkeypatch: pytest.MonkeyPatch, meters: Path) -> None:
    """Put these fakes in place of a search's parts. `model=keyless` cannot be opened."""

    def model(config: RunConfig, held: int) -> ScriptedModel:
        if config.model == "keyless":
            raise ModelError("The endpoint refused the key; check OPENAI_API_KEY.")
        script = SCRIPTS.get(config.model, [])  # a run that has all its replies replays them and asks for none
        return MeteredModel(script, said=held, name=f"{config.model}-{config.seed}", meter=meters / "asked")

    def trainer(*, snapshots: Path, **_: object) -> ToyTrainer:
        return MeteredTrainer(meter=meters / "trained", cell=snapshots.parent.name)

    monkeypatch.setattr(compose, "open_model", model)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr(compose, "Sandbox", lambda *_, **__: nullcontext(ToyChecker()))
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", trainer)


def lines(meters: Path, name: str) -> list[str]:
    path = meters / name
    return sorted(path.read_text().splitlines()) if path.exists() else []
