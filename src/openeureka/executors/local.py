"""Lanes on this machine: one process per GPU or core, so that a crash of the simulator never takes a run down."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from pathlib import Path

import torch

from ..cores import usable_cores
from ..sim import check_device
from ..tasks import registry
from ..types import LaneSpec, TrainBudget, TrainingEvent
from . import retry, scheduler
from .retry import Errand
from .transport import SILENCE, Processes, Seat

CPU = "cpu"
CPU_WORKERS = 8
"""The most processes that share one CPU: each costs 0.4 GB of memory before its worlds."""
MAX_WORLDS = {"cpu": 16384, "cuda": 65536}
"""On a CPU a world costs about 0.15 MB, almost whatever the model (measured on Cartpole and Humanoid). On a GPU the
simulator alone takes 76 kB (Ant) to 2.1 MB (two hands) a world, 5 to 139 GB for all of them (measured on an H200)."""


def devices(setting: str) -> tuple[str, ...]:
    """One name for each worker process: `cuda` is every GPU that this process sees; commas separate several names.

    Raises:
        ConfigError: when this machine lacks one of them.
    """
    found: list[str] = []
    for name in setting.split(","):
        check_device(name.strip())
        # Counting does not initialise CUDA, which would take memory from the workers.
        gpus = [f"cuda:{index}" for index in range(torch.cuda.device_count())]
        found += gpus if name.strip() == "cuda" else [name.strip()]
    return tuple(found)


def workers(devices: Sequence[str], threads: int, populations: int) -> tuple[Seat, ...]:
    """A seat for each worker process, for up to `populations` that train side by side.

    On one CPU each population gets a process, as far as there are cores: the small operations of one population keep
    only a single core busy.

    Args:
        threads: of all workers on a CPU together, or of each worker where several devices are named; 0 for all cores.
    """
    if tuple(devices) != (CPU,):
        return tuple(Seat(device, threads) for device in devices)
    available = threads or usable_cores()
    count = max(1, min(available, populations, CPU_WORKERS))
    return (Seat(CPU, available // count),) * count


class LocalExecutor(retry.Questions):
    """A `types.Trainer`: the lanes of a call form one population per worker, or several in turn when they are too many
    for one simulation.

    Args:
        device: where to train, see `devices`; a GPU has one worker process, a CPU may have several, see `workers`.
        threads: simulation and tensor threads, 0 for all cores.
        snapshots: folder in which trainings that take minutes leave their state, to continue from after this process
            or a worker is killed; None for trainings that begin anew.
        module: what the worker runs; tests replace it.
        silence: [s] after which a worker that says nothing is ended and replaced.
        max_worlds: the most worlds on a device at a time, over all lanes; 0 for what the kind of device usually holds.

    Raises:
        ConfigError: when there is no such device.
    """

    def __init__(
        self,
        device: str = "cpu",
        threads: int = 0,
        *,
        snapshots: Path | None = None,
        module: str = "openeureka.executors.child",
        silence: float = SILENCE,
        max_worlds: int = 0,
    ) -> None:
        self._devices = devices(device)
        self._threads, self._snapshots = threads, snapshots
        super().__init__(Processes(module, silence), Seat(self._devices[0], threads))
        kind = "cuda" if self._devices[0].startswith("cuda") else "cpu"
        self._max_worlds = max_worlds or MAX_WORLDS[kind]

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Generator[TrainingEvent]:
        """Train every lane. A worker that dies or hangs is started again with those of its lanes that have no result
        yet, then once more for each of them alone; those that die even so are FAILED with the reason.

        Raises:
            TaskError: when there is no such environment, or its own code fails.
            WorkerError: when no lane of a population could be trained, and then not even the task's human reward for
                one epoch: the machine is at fault, not a generated reward.
        """
        worlds = budget.worlds or registry.get(env).recipe.worlds
        crew = [seat.device for seat in workers(self._devices, self._threads, len(lanes))]
        room = self._max_worlds // max(map(crew.count, crew))  # of one worker, where several share a device
        count = max(len(crew), math.ceil(len(lanes) / max(1, room // worlds)))
        dealt = scheduler.deal(lanes, retry.together(self._snapshots, env, budget, crew[0]), count)
        errands = [Errand(env, share, budget, self._snapshots) for share in dealt]
        return scheduler.train(self._transport, errands, workers(self._devices, self._threads, len(errands)))
