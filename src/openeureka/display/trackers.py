"""Mirrors of a run in somebody's experiment tracker: settings, curves, texts and films, where `log=` asks for one.

wandb and MLflow are imported only here, and only when `log=` names them. A tracker that fails is left out from then on,
with one line of text: no search ends for its mirror.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from ..config import RunConfig
from ..errors import ConfigError, EurekaError
from ..events import Began, Event
from ..report.tensorboard import TensorBoard
from ..report.view import RunView
from ..score import Outcome
from ..store import artifacts
from ..text import plain
from ..types import Generation, TrainingResult

MEMORY = "tracker.json"
"""The file with the tracker's id of the run, by which a resumed run goes on there."""


class Tracker(Protocol):
    """Somebody's experiment tracker, as far as a mirror needs it."""

    def numbers(self, values: Mapping[str, float], step: int | None = None) -> None:
        """Log values by name; without a step they are a summary of the run."""
        ...

    def text(self, name: str, text: str) -> None: ...
    def film(self, name: str, file: Path) -> None: ...
    def close(self) -> None: ...


class Wandb:
    """A run of the project `openeureka`, under the rules that the environment sets for wandb."""

    def __init__(self, directory: Path, config: RunConfig) -> None:
        self._wandb = _imported("wandb")
        self._run = self._wandb.init(
            project="openeureka",
            name=directory.name,
            dir=str(directory),
            config=asdict(config),
            id=_remembered(directory, "wandb"),
            resume="allow",
        )
        _remember(directory, "wandb", self._run.id)
        self._run.define_metric("epoch")
        self._run.define_metric("*", step_metric="epoch")

    def numbers(self, values: Mapping[str, float], step: int | None = None) -> None:
        if step is None:
            self._run.summary.update(dict(values))
        else:
            self._run.log({**values, "epoch": step})

    def text(self, name: str, text: str) -> None:
        self._run.log({name: self._wandb.Table(columns=["text"], data=[[text]])})

    def film(self, name: str, file: Path) -> None:
        self._run.log({name: self._wandb.Video(str(file), format="mp4")})

    def close(self) -> None:
        self._run.finish()


class Mlflow:
    """A run of the experiment `openeureka`, at the address that the environment sets for MLflow."""

    def __init__(self, directory: Path, config: RunConfig) -> None:
        self._mlflow = _imported("mlflow")
        self._mlflow.set_experiment("openeureka")
        known = _remembered(directory, "mlflow")
        run = self._mlflow.start_run(run_id=known, run_name=None if known else directory.name)
        if known is None:
            _remember(directory, "mlflow", run.info.run_id)
            self._mlflow.log_params({name: str(value)[:500] for name, value in asdict(config).items()})

    def numbers(self, values: Mapping[str, float], step: int | None = None) -> None:
        self._mlflow.log_metrics(dict(values), step=step)

    def text(self, name: str, text: str) -> None:
        self._mlflow.log_text(text, f"{name}.txt")

    def film(self, name: str, file: Path) -> None:
        self._mlflow.log_artifact(str(file), name)

    def close(self) -> None:
        self._mlflow.end_run()


TRACKERS: Mapping[str, Callable[[Path, RunConfig], Tracker]] = {
    "wandb": Wandb,
    "mlflow": Mlflow,
    "tensorboard": TensorBoard,
}
_ADVICE = {"mlflow": "; MLFLOW_TRACKING_URI must name a server, because MLflow's small package has no store"}


class Mirror:
    """Tells a tracker what a run finishes."""

    def __init__(self, name: str, directory: Path, config: RunConfig) -> None:
        self._name, self._directory, self._config = name, directory, config
        self._tracker: Tracker | None = None
        self._begun = self._under_way = False

    def __call__(self, event: Event) -> None:
        match event:
            case Began():
                self._under_way = True
                self._open()  # before anything trains, so that a person learns at once where it fails
            case TrainingResult():
                self._curves(event)
            case Generation() if self._under_way:  # a resumed run first repeats generations that the tracker knows
                self._generation(event)
            case Outcome():
                if scores := event.method.scores:
                    self._tell("numbers", {"held-out F": sum(scores) / len(scores)})
            case _:
                pass

    def _curves(self, result: TrainingResult) -> None:
        for epoch in range(max(map(len, result.over_epochs.values()), default=0)):
            found = {name: curve[epoch] for name, curve in result.over_epochs.items() if epoch < len(curve)}
            values = {f"{result.lane}/{name}": value for name, value in found.items() if value is not None}
            if values:
                self._tell("numbers", values, epoch)

    def _generation(self, generation: Generation) -> None:
        if generation.best is not None and generation.best.score is not None:
            self._tell("numbers", {"best F": generation.best.score}, generation.index)
        for entry in generation.entries:
            if entry.sample.candidate is not None:
                self._tell("text", f"programs/{entry.sample.place}", plain(entry.sample.candidate.source))

    def films(self) -> None:
        """Send all films, once the run is done and its report has made them."""
        for name, path in RunView.read(self._directory).videos.items():
            self._tell("film", f"films/{name}", self._directory / path)

    def close(self) -> None:
        if self._tracker is not None:
            self._tell("close")

    def _open(self) -> None:
        if not self._begun:
            self._begun = True
            try:
                self._tracker = TRACKERS[self._name](self._directory, self._config)
            except Exception as error:
                self._say(f"cannot record this run{_ADVICE.get(self._name, '')}", error)

    def _tell(self, verb: str, *said: object) -> None:
        """Call the tracker. Whatever its library raises ends the mirror and not the run."""
        self._open()
        try:
            if self._tracker is not None:
                getattr(self._tracker, verb)(*said)
        except Exception as error:
            failed, self._tracker = self._tracker, None
            self._say("stopped recording this run", error)
            if failed is not None and verb != "close":
                with suppress(Exception):  # left open, it would log the next run of this process
                    failed.close()

    def _say(self, what: str, error: Exception) -> None:
        print(f"log={self._name} {what}: {plain(str(error)).strip()[:300]}", flush=True)


@contextmanager
def mirrored(directory: Path, config: RunConfig) -> Iterator[list[Mirror]]:
    """The mirror for the tracker that the settings name; empty where they name none.

    Raises:
        ConfigError: when the tracker's package is not installed.
    """
    if not config.log:
        yield []
        return
    if config.log != "tensorboard":
        _imported(config.log)
    mirror = Mirror(config.log, directory, config)
    try:
        yield [mirror]
    finally:
        mirror.close()


def _imported(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise ConfigError(f"log={name} needs a package: pip install 'openeureka[{name}]'.") from None


def _remembered(directory: Path, tracker: str) -> str | None:
    try:
        found = json.loads(artifacts.read(directory, MEMORY) or b"{}").get(tracker)
    except (ValueError, AttributeError, EurekaError):
        return None
    return found if isinstance(found, str) else None


def _remember(directory: Path, tracker: str, name: str) -> None:
    artifacts.write(directory, MEMORY, json.dumps({tracker: name}))
