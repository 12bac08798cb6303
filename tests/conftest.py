"""Tests are offline and never reach a paid endpoint: API keys and proxies are removed from the environment, and sockets
connect to loopback only."""

import copy
import itertools
import os
import signal
import socket
import sys
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from lasting import Pool

if TYPE_CHECKING:
    import mujoco

    from openeureka.tasks.task import Task

os.environ.setdefault("OMP_NUM_THREADS", "2")
os.environ.setdefault("GOMP_SPINCOUNT", "0")  # idle OpenMP threads that spin starve the simulator's threads
for key in [name for name in os.environ if name.upper().endswith(("_API_KEY", "_PROXY"))]:
    del os.environ[key]
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell sets it for background jobs
    signal.signal(signal.SIGINT, signal.default_int_handler)

_connect = socket.socket.connect


def _loopback_only(self: socket.socket, address: object) -> None:
    if self.family in (socket.AF_INET, socket.AF_INET6):
        host = str(address[0]) if isinstance(address, tuple) else str(address)
        if host not in ("127.0.0.1", "localhost", "::1"):
            raise OSError(f"a test tried to reach {host}")
    _connect(self, address)  # pyright: ignore[reportArgumentType]


@pytest.fixture(scope="session", autouse=True)
def never_synced() -> Iterator[None]:
    """Turns disk syncs off. They guard against a power cut, which no test can make, and the suite's 130,000 syncs took
    minutes."""
    from openeureka.store.db import Database

    prepare = Database._prepare

    def prepared(self: Database, writable: bool, migrate: bool) -> None:
        prepare(self, writable, migrate)
        if writable:
            self._connection.execute("PRAGMA synchronous = OFF")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Database, "_prepare", prepared)
        patch.setattr(os, "fsync", os.fstat)  # like fsync, it fails for a descriptor that is not open
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled_once() -> Iterator[None]:
    """Compiles each model of openeureka's suite once per process, and copies it from then on. Otherwise the suite would
    compile two hands 300 times, at 0.15 s each."""
    if "openeureka.tasks.task" not in sys.modules:  # no collected test imports tasks at its top: few simulate, or none
        yield
        return
    from openeureka.tasks.task import Task

    real, known = Task.compile_model.__func__, dict[Hashable, "mujoco.MjModel"]()

    def compile_model(cls: "type[Task]") -> "mujoco.MjModel":
        shipped = getattr(cls.model, "__module__", "").startswith("openeureka.suite.")
        if not shipped or getattr(cls.compiled, "__func__", None) is not Task.compiled.__func__:
            return real(cls)
        key = (cls.model, cls.control_dt, cls.substeps)
        if key not in known:
            known[key] = real(cls)
        return copy.copy(known[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Task, "compile_model", classmethod(compile_model))
        yield


@pytest.fixture(scope="session", autouse=True)
def packages_looked_up_once() -> Iterator[None]:
    """Keeps the entry points of what is installed. A command looks them up several times, and each time takes
    milliseconds."""
    from importlib.metadata import EntryPoints, entry_points

    from openeureka import plugins

    known = dict[tuple[str, ...], EntryPoints]()

    def kept(*, group: str) -> EntryPoints:
        place = (group, *sys.path)
        if place not in known:
            known[place] = entry_points(group=group)
        return known[place]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plugins, "entry_points", kept)
        yield


@pytest.fixture(scope="session")
def training_workers() -> Iterator[Pool]:
    pool = Pool()
    yield pool
    pool.close()


@pytest.fixture
def lasting(training_workers: Pool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trains in workers that other tests have used, for those to which a worker's beginning and end do not matter."""
    monkeypatch.setattr("openeureka.executors.transport.Worker", training_workers)


@pytest.fixture(scope="session")
def homes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Yields a new folder for each test. `mktemp` would list all existing ones each time."""
    above = tmp_path_factory.mktemp("homes")
    return (above / str(number) for number in itertools.count())


@pytest.fixture(autouse=True)
def at_home(homes: Iterator[Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A state folder for each test: the commands' record of what was typed (`runs/trust.py`) is shared neither with
    other tests nor with the user."""
    home = next(homes)
    home.mkdir()
    monkeypatch.setenv("XDG_STATE_HOME", str(home))
    return home


@pytest.fixture(autouse=True)
def offline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket.socket, "connect", _loopback_only)
