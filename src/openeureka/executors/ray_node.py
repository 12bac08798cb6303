"""What runs on the nodes of a Ray cluster: it passes frames between the driver and a worker, and describes its node.

Ray starts it from the package that is installed on the node. It imports neither torch nor a simulator: the worker does.
"""

from __future__ import annotations

import hashlib
import os
import platform
import time
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from ..errors import EurekaError, TaskError
from ..parsing import named_file
from ..version import __version__
from ..worker import framed, unframed
from .transport import ProcessCall, Processes, Seat

DECIDING = ("torch", "mujoco")
"""Packages whose versions decide the numbers of a training, besides this one and Python."""
ON_GPUS = ("mujoco-warp",)
"""Further such packages where a GPU steps the worlds."""

FOREVER = 1e8
"""[s] About the longest wait that the kernel accepts."""


def versions() -> dict[str, str]:
    """Versions that decide the numbers of a training, by name. Builds for a CPU and for CUDA count as one version."""
    found = {"openeureka": __version__, "Python": ".".join(platform.python_version_tuple()[:2])}
    for name in (*DECIDING, *ON_GPUS):
        try:
            found[name] = version(name).partition("+")[0]
        except PackageNotFoundError:
            found[name] = "none"
    return found


def task_digest(env: str) -> str:
    """Digest of the file that a person's own task is in; empty where there is no such file, or it is not here."""
    file = named_file("env", env)
    with suppress(OSError):
        return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file and not env.startswith("python:") else ""
    return ""


def about(env: str = "") -> dict[str, Any]:
    """This node, in plain data: `memory` the free bytes, `time` in seconds of its clock, `task` the digest of
    the file that the task is in."""
    import ray

    return {
        "id": ray.get_runtime_context().get_node_id(),
        "host": platform.node(),
        "token": os.environ.get("RAY_AUTH_MODE", "").lower() == "token",
        "versions": versions(),
        "task": task_digest(env),
        "memory": _free_memory(),
        "time": time.time(),
    }


def _free_memory() -> int:
    with suppress(OSError, ValueError), open("/proc/meminfo") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith("MemAvailable"))
    return 0


class Share:
    """An actor that has one request served by a child process, and survives whatever happens to that."""

    def __init__(self, module: str) -> None:
        self._processes = Processes(module, silence=FOREVER)  # the driver watches for silence
        self._call: ProcessCall | None = None

    def serve(self, request: bytes, device: str, threads: int) -> Iterator[bytes]:
        """Frames of the worker, after one that describes this node; `died` says in a sentence how the worker ended."""
        asked = unframed(request)
        yield framed({"node": about(asked.header["env"])})
        self._call = self._processes.call(asked, Seat(device, threads))
        try:
            while True:
                frame = self._call.receive()
                yield framed(frame.header, frame.blobs)
                if frame.header.get("done"):
                    return
        except EurekaError as error:
            yield framed({"broken" if isinstance(error, TaskError) else "died": str(error)})
        finally:
            self._call.close()

    def stop(self) -> None:
        """While `serve` is under way: ask the worker to end, with a snapshot."""
        if self._call is not None:
            self._call.stop()
