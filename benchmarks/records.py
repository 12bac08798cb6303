"""What the scripts of this folder share: their command line, and the JSON that they write, with machine and date."""

from __future__ import annotations

import argparse
import json
import os
import platform
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"
OUTPUTS = ROOT / "outputs"
"""Runs in which scripts train."""

Record = dict[str, Any]


def command_line(doc: str | None) -> argparse.ArgumentParser:
    """A parser whose help begins with a script's docstring, as it stands."""
    return argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)


def amount(text: str) -> int:
    """A number of steps or the like from a command line, such as `3e6`."""
    return int(float(text))


def results(name: str) -> Path:
    """Where a script writes what it found."""
    return FOLDER / "results" / f"{name}.json"


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


def conditions(*packages: str) -> Record:
    """What `machine` says, and what else a speed depends on, with the load at this moment."""
    found = machine("cpu", *packages)
    speed = {"cores": os.cpu_count(), "python": platform.python_version(), "load_at_end": os.getloadavg()[0]}
    return {"date": found.pop("date"), "versions": found.pop("versions"), "machine": {**found, **speed}}


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
