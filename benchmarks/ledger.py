"""What the scripts of this folder share: runs that train given rewards, and how their results become JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch

from openeureka import given, hacking
from openeureka.cli.terminal import Terminal
from openeureka.config import TrainConfig
from openeureka.errors import EurekaError
from openeureka.lanes import Lanes, Wanted
from openeureka.report.build import build
from openeureka.runs.compose import comparing
from openeureka.runs.rewards import named
from openeureka.types import Evaluation, Peak, TrainingResult

OUTPUTS = Path(__file__).parents[1] / "outputs"
PEAKS: tuple[Peak, ...] = ("fitness", "reward")
"""The policies whose held-out F stands in a record of a lane."""
POINTS = 40  # of each curve in a file

Record = dict[str, Any]
Learned = dict[str, tuple[TrainingResult, Mapping[Peak, Evaluation]]]
"""Results without policies, and held-out scores of policies, by lane id."""


class _Script(Terminal):
    def again(self, directory: Path) -> str:
        return "the same command"


def learn(config: TrainConfig, peaks: Sequence[Peak], more: Iterable[Wanted] | None = None) -> Learned:
    """Train what the run in `config.dir` lacks, score these policies of every lane, and leave a report.

    Args:
        config: of the run; `eureka train` with the same settings goes on with it.
        peaks: policies that are scored, in the same held-out episodes as the one that stands for its lane.
        more: see `given.train`.

    Raises:
        SystemExit: with a sentence, where a person can do something about it.
    """
    directory = Path(config.dir)
    try:
        with comparing(config.run(), directory, _Script()) as lanes:
            given.keep(lanes.store, named(config))
            given.train(lanes, more)
            scores, results = _held_out(lanes, peaks), lanes.store.lanes.results()
        build(directory, "none", config.env)
    except EurekaError as error:
        raise SystemExit("\n".join([str(error), *getattr(error, "__notes__", ())])) from None
    return {lane: (result, scores.get(lane, {})) for lane, result in results.items()}


def _held_out(lanes: Lanes, peaks: Sequence[Peak]) -> dict[str, dict[Peak, Evaluation]]:
    """Scores by lane id and policy, as far as a lane has it."""
    log = lanes.store.lanes
    known = {(lane, score.peak): score for lane, score in log.evaluations().items()}
    others = [(lane, peak) for lane, _ in known for peak in peaks if (lane, peak) not in known]
    lanes.try_out(hacking.Trial(lane=lane, name=hacking.PEAKS[peak], peak=peak) for lane, peak in others)
    tried = log.trials()
    found: dict[str, dict[Peak, Evaluation]] = {}
    for lane, peak in [*known, *others]:
        score = known.get((lane, peak)) or tried.get(lane, {}).get(hacking.PEAKS[peak])
        if peak is not None and score is not None:
            found.setdefault(lane, {})[peak] = score
    return found


def record(result: TrainingResult, held_out: Mapping[Peak, Evaluation]) -> Record:
    """A lane as JSON, with the held-out scores of the policies at both peaks.

    F at first is that of the first episodes that end: of a policy that has hardly trained, exploring.
    """
    return {
        "state": str(result.state),
        "message": result.message,
        "env_steps": result.env_steps,
        "fitness_at_first": next((f for f in result.curves.get("fitness", ()) if f is not None), None),
        "fitness_max_over_epochs": result.fitness,
        "held_out_at_peak_of_fitness": _score(held_out.get("fitness")),
        "held_out_at_peak_of_reward": _score(held_out.get("reward")),
        "correlation_with_human": result.correlation,
        "curves": thinned(result.curves),
    }


def _score(held_out: Evaluation | None) -> Record:
    return {
        "fitness": held_out.fitness if held_out else None,
        "episode_length": held_out.episode_length if held_out else None,
    }


def thinned(curves: Mapping[str, Sequence[float | None]]) -> dict[str, list[float | None]]:
    """Evenly spaced points of the curves that tell the story."""
    shown = {name: curves[name] for name in ("fitness", "episode_length", "reward") if name in curves}
    return {
        name: [None if value is None else round(value, 4) for value in curve[:: max(1, -(-len(curve) // POINTS))]]
        for name, curve in shown.items()
    }


def machine(device: str) -> Record:
    """Where and when, for the record."""
    cores = f"{len(os.sched_getaffinity(0))} cores, {platform.machine()}"
    return {
        "device": torch.cuda.get_device_name(device.split(",")[0]) if device.startswith("cuda") else cores,
        "date": today(),
        "versions": {name: version(name) for name in ("torch", "mujoco")},
    }


def today() -> str:
    return datetime.now(UTC).date().isoformat()


def read(path: Path) -> Record:
    return json.loads(path.read_text()) if path.exists() else {}


def write(path: Path, content: Record) -> None:
    """Replace the file whole, so that a broken-off run leaves the old or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(content, indent=1) + "\n")
    temporary.replace(path)
