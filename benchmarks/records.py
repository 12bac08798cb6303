"""The JSON that scripts of this folder write: trainings and measurements, with machine and date."""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from openeureka.numbers import number
from openeureka.stats import Difference, Estimate, midranks, pearson
from openeureka.types import Evaluation, Peak, TrainingResult

if TYPE_CHECKING:
    from openeureka.config import RunConfig

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"
OUTPUTS = ROOT / "outputs"
"""Runs in which scripts train."""
PEAKS: tuple[Peak, ...] = ("fitness", "reward")
"""The policies whose held-out F stands in a record of a lane."""
POINTS = 40  # of each curve in a file

Record = dict[str, Any]
Lane = TypeVar("Lane")


def command_line(doc: str | None) -> argparse.ArgumentParser:
    """A parser whose help begins with a script's docstring, as it stands."""
    return argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def amount(text: str) -> int:
    """A number of steps or the like from a command line, such as `3e6`."""
    return int(float(text))


def results(name: str) -> Path:
    """Where a script writes what it found."""
    return FOLDER / "results" / f"{name}.json"


def record(result: TrainingResult, held_out: Mapping[Peak, Evaluation]) -> Record:
    """A lane as JSON, with the held-out scores of the policies at both peaks.

    `fitness_at_first` is F of the first episodes that end, under a policy that explores and has hardly trained.
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
    """Evenly spaced points of the most telling curves."""
    shown = {name: curves[name] for name in ("fitness", "episode_length", "reward") if name in curves}
    return {
        name: [None if value is None else round(value, 4) for value in curve[:: max(1, -(-len(curve) // POINTS))]]
        for name, curve in shown.items()
    }


def machine(device: str, *packages: str) -> Record:
    """Device and date of a training or measurement, and the versions of PyTorch, MuJoCo and these packages.

    Rounding differs between kinds of processor, and training amplifies it: numbers repeat to the bit on one kind.
    """
    import torch  # not at the top: making tables of records does not need it

    cores = f"{len(os.sched_getaffinity(0))} cores, {platform.machine()}, {torch.backends.cpu.get_cpu_capability()}"
    return {
        "device": torch.cuda.get_device_name(device.split(",")[0]) if device.startswith("cuda") else cores,
        "processor": processor(),
        "date": today(),
        "versions": {name: _version(name) for name in dict.fromkeys(("torch", "mujoco", *packages))},
    }


def _version(package: str) -> str | None:
    """The installed version; None where there is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def processor() -> str:
    """The processor's name, family and model."""
    table = Path("/proc/cpuinfo")
    if not table.exists():
        return platform.processor()
    pairs = (line.partition(":") for line in table.read_text().split("\n\n")[0].splitlines())
    known = {name.strip(): value.strip() for name, _, value in pairs}
    parts = [known.get("model name"), *(f"{name} {known[name]}" for name in ("cpu family", "model") if name in known)]
    return ", ".join(part for part in parts if part) or platform.machine()


def interval(value: float, low: float, high: float, digits: int = 4) -> str:
    """A difference and the ends of its interval, for a table."""
    return f"{number(value, digits)} ({number(low, digits)} to {number(high, digits)})"


def told(found: Difference | Estimate | None, digits: int = 4) -> str:
    """The same; a dash where there is no interval."""
    if found is None or found.low is None or found.high is None:
        return "-"
    return interval(found.value, found.low, found.high, digits)


def ends(found: Difference | None) -> list[float] | None:
    """A difference and the ends of its interval, for a record."""
    return None if found is None else [found.value, found.low, found.high]


def reward_and_seed(lane: str) -> tuple[str, int]:
    """What a lane's id is made of, see `lane_id`."""
    reward, _, seed = lane.rpartition("-s")
    return reward, int(seed)


def by_reward(lanes: Mapping[str, Lane]) -> dict[str, dict[int, Lane]]:
    """What is known of lanes, by reward and seed."""
    found: dict[str, dict[int, Lane]] = {}
    for lane, known in lanes.items():
        reward, seed = reward_and_seed(lane)
        found.setdefault(reward, {})[seed] = known
    return found


def conditions(*packages: str) -> Record:
    """What `machine` says, and what else a speed depends on, with the load at this moment."""
    found = machine("cpu", *packages)
    speed = {"cores": os.cpu_count(), "python": platform.python_version(), "load_at_end": os.getloadavg()[0]}
    return {"date": found.pop("date"), "versions": found.pop("versions"), "machine": {**found, **speed}}


def joined(entry: Record, key: str, lanes: Record, config: RunConfig, name: str) -> Record:
    """A task's record with the lanes and the settings of one more run.

    Args:
        key: under which the record holds its lanes.
        lanes: of the run `name`.

    Raises:
        SystemExit: where another run has a different lane of the same id.
    """
    known, runs = entry.get(key, {}), entry.get("runs", {})
    own = runs.get(name, {}).get("lanes", ())
    if others := [lane for lane in lanes if lane in known and lane not in own and known[lane] != lanes[lane]]:
        raise SystemExit(f"{name} has another {others[0]} than the results, so its lanes cannot join them.")
    settings = {word: getattr(config, word) for word in ("model", "seed", "steps", "worlds", "schedule")}
    run = {**settings, **machine(config.device), "lanes": list(lanes)}
    return {**entry, key: {**known, **lanes}, "runs": {**runs, name: run}}


def rounded(value: float | None) -> float | None:
    """To five digits."""
    return None if value is None else float(f"{value:.5g}")


def correlation(xs: Sequence[float], ys: Sequence[float]) -> float | None:
    """Spearman's rank correlation; None below three pairs and where one side is constant."""
    return pearson(midranks(xs).tolist(), midranks(ys).tolist()) if len(xs) > 2 else None


def today() -> str:
    return datetime.now(UTC).date().isoformat()


def read(path: Path) -> Any:
    """The content of a JSON file; empty where there is no file."""
    return json.loads(path.read_text()) if path.exists() else {}


def write(path: Path, content: object) -> None:
    """Replace the file at once: a script that is killed leaves either the old or the new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(content, indent=1) + "\n")
    temporary.replace(path)


def keep(path: Path, name: str, row: object) -> None:
    """Add a row to the file as it is now: another script may have written since this one read it."""
    write(path, read(path) | {name: row})


def once(path: Path, name: str, measure: Callable[[], Record]) -> Record:
    """A row of the file, measured where it is missing."""
    if name not in read(path):
        keep(path, name, measure())
    return read(path)[name]


def show(*rows: Sequence[str]) -> None:
    """Print a table as it grows."""
    for row in rows:
        print(*row, sep=" | ", flush=True)
