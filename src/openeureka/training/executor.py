"""Runs training in worker processes, one a GPU or core, so that a crash of the simulator never takes a run down."""

from __future__ import annotations

import dataclasses
import math
import os
import time
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from ..codec import plain, shaped
from ..errors import TaskError, WorkerError
from ..tasks import registry
from ..types import Dynamics, Evaluation, TrainBudget, TrainingProgress, TrainingResult, TrainingState, TrainJob
from ..worker import Frame, Worker, WorkerDied, WorkerTimeout
from . import snapshots
from .devices import devices, workers
from .snapshots import Snapshot
from .wire import SNAPSHOT, pack_jobs, unpack

SILENCE = 600.0
"""[s] without a sign of life after which a worker counts as hung; it reports every second and compiles for seconds."""
MAX_WORLDS = {"cpu": 16384, "cuda": 65536}
"""A world costs about 0.15 MB, of which the model hardly matters (measured on Cartpole and Humanoid, on the CPU)."""
SNAPSHOT_SECONDS = 300.0
"""[s] between two snapshots of a training; one takes a fraction of a second."""
FAREWELL = 10.0
"""[s] that a worker may take for a last snapshot when the training is stopped; it looks every second."""
POLL = 0.05
"""[s] that one worker is waited for before the next gets a look."""

CONTROL = "control"
"""The job that tells a fault of the rewards from one of the machine."""

Message = TrainingProgress | TrainingResult
T = TypeVar("T")


class PopulationTrainer:
    """A `types.Trainer`: the jobs of a call are lanes of one population a worker, or of several in turn when they are
    too many for one simulation.

    Args:
        device: where to train, see `devices`; a GPU has one worker process, a CPU may have several, see `workers`.
        threads: simulation and tensor threads, 0 for all cores.
        max_worlds: the most worlds on a device at a time, over all lanes; 0 for what the kind of device usually holds.
        snapshots: folder in which trainings that take minutes leave their state, to go on from when this process or a
            worker is killed; None for trainings that begin anew.
        silence: [s] after which a worker that says nothing is ended and replaced.
        module: what the worker runs; tests replace it.

    Raises:
        ConfigError: when there is no such device.
    """

    def __init__(
        self,
        device: str = "cpu",
        threads: int = 0,
        *,
        snapshots: Path | None = None,
        module: str = "openeureka.training.worker",
        silence: float = SILENCE,
        max_worlds: int = 0,
    ) -> None:
        self._devices = devices(device)
        self._threads = threads
        self._module, self._silence, self._snapshots = module, silence, snapshots
        kind = "cuda" if self._devices[0].startswith("cuda") else "cpu"
        self._max_worlds = max_worlds or MAX_WORLDS[kind]

    def train(self, env: str, jobs: Sequence[TrainJob], budget: TrainBudget) -> Generator[Message]:
        """Train every job. A worker that dies or hangs is started again with those of its jobs that have no result yet,
        then once more for each of them alone; those that die even so are FAILED with the reason.

        Raises:
            TaskError: when there is no such environment, or its own code fails.
            WorkerError: when no job of a population could be trained, nor then the task's human reward, tried for an
                epoch: the machine is at fault, and no generated reward.
        """
        recipe = registry.get(env).recipe
        worlds = budget.worlds or recipe.worlds
        crew = [device for device, _ in workers(self._devices, self._threads, len(jobs))]
        room = self._max_worlds // max(map(crew.count, crew))  # of one worker, where several share a device
        kept = snapshots.groups(self._snapshots, env)
        populations = _deal(jobs, kept, max(len(crew), math.ceil(len(jobs) / max(1, room // worlds))))
        waiting = deque(enumerate(populations))
        tally = _Tally(len(populations))

        def serve(device: str, threads: int) -> Generator[Message | None]:
            while waiting:
                number, population = waiting.popleft()
                for message in self._train(env, population, budget, device, threads):
                    yield tally.add(number, message) if isinstance(message, TrainingProgress) else message
                tally.close(number)

        yield from _interleave([serve(*worker) for worker in workers(self._devices, self._threads, len(populations))])

    def _train(
        self, env: str, jobs: Sequence[TrainJob], budget: TrainBudget, device: str, threads: int
    ) -> Generator[Message | None]:
        """Messages of one population; None while there is nothing yet."""
        left = {job.id: job for job in jobs}
        reasons: dict[str, str] = {}
        # Together, together once more, then one by one: a lane that kills its process takes no other with it.
        for groups in (1, 1, len(jobs)):
            for group in _split(list(left.values()), groups):
                try:
                    for message in self._train_in_one(pack_jobs(env, group, budget), device, threads):
                        if isinstance(message, TrainingResult):
                            del left[message.job]
                        yield message
                except WorkerError as error:
                    reasons |= {job.id: str(error) for job in group}
        if len(left) == len(jobs) and not any(isinstance(job.program, str) for job in jobs):
            self._control(env, jobs[0].seed, budget, device, threads, reasons[jobs[0].id])
        yield from (_failed(job, reasons[job.id]) for job in left.values())

    def _control(self, env: str, seed: int, budget: TrainBudget, device: str, threads: int, reason: str) -> None:
        """Raises WorkerError unless the human reward trains where every generated one ended its worker."""
        brief = dataclasses.replace(budget, env_steps=1)
        request = pack_jobs(env, [TrainJob(id=CONTROL, program="human", seed=seed)], brief)
        try:
            for _ in self._ask(Frame({"do": "train", "snapshot_seconds": 0.0, **request.header}), device, threads):
                pass
        except WorkerError:
            raise WorkerError(reason) from None

    def _train_in_one(self, request: Frame, device: str, threads: int) -> Generator[Message | None]:
        """Messages of one worker, which goes on from where the one before it was."""
        kind = device.partition(":")[0]
        snapshot = Snapshot(self._snapshots, {**request.header, "device": kind})
        state = snapshot.read()
        every = SNAPSHOT_SECONDS if self._snapshots is not None else 0.0
        header = {"do": "train", "snapshot_seconds": every, **request.header}
        blobs = {**request.blobs, **({SNAPSHOT: state} if state is not None else {})}
        try:
            for frame in self._ask(Frame(header, blobs), device, threads, keep=snapshot if every else None):
                if frame is not None and SNAPSHOT in frame.blobs:
                    snapshot.write(frame.blobs[SNAPSHOT])
                else:
                    yield unpack(frame) if frame is not None else None
        except WorkerError:
            snapshot.distrust()
            raise
        snapshot.remove()

    def evaluate(
        self,
        env: str,
        policies: Mapping[str, bytes],
        *,
        seed: int,
        episodes: int = 0,
        dynamics: Mapping[str, Dynamics] | None = None,
    ) -> Iterator[Evaluation]:
        """Score of each policy, on the first device. A worker that dies is started again once.

        Raises:
            TaskError: when the task's own code fails.
            WorkerError: when it dies again.
        """
        header = {"do": "evaluate", "env": env, "seed": seed, "episodes": episodes, "dynamics": plain(dynamics or {})}
        left = dict(policies)
        for last in (False, True):
            if not left:
                return
            try:
                for frame in self._ask(Frame(header, left), self._devices[0], self._threads):
                    if frame is not None and "score" in frame.header:
                        score = shaped(Evaluation, frame.header["score"])
                        del left[score.job]
                        yield score
            except WorkerError:
                if last and left:
                    raise

    def _ask(self, request: Frame, device: str, threads: int, keep: Snapshot | None = None) -> Generator[Frame | None]:
        """Frames of one request, up to the one that says it is done; None while there is nothing yet.

        Where a training is stopped, by Ctrl-C or as nobody wants more, `keep` receives its state.
        """
        # Idle OpenMP threads that spin would starve the simulator's threads, many times over on a busy machine.
        with Worker(self._module, env={"GOMP_SPINCOUNT": "0", **os.environ}) as worker:
            try:
                worker.send({**request.header, "device": device, "threads": threads}, request.blobs)
                heard = time.monotonic()
                while True:
                    if worker.ready(POLL):
                        frame, heard = worker.receive(self._silence), time.monotonic()
                        if frame.header.get("done"):
                            return
                        if "broken" in frame.header:
                            raise TaskError(frame.header["broken"])
                        yield frame
                    elif time.monotonic() - heard > self._silence:
                        raise WorkerTimeout("The worker process did not answer in time.")
                    else:
                        yield None
            except (KeyboardInterrupt, GeneratorExit):
                if keep is not None:
                    _part(worker, keep)
                raise
            except (WorkerDied, WorkerTimeout) as error:
                ending = worker.ending() if isinstance(error, WorkerDied) else ""
                said = worker.stderr_tail().splitlines()[-1:]
                parts = [f"Training stopped: {error}", ending, *said]
                raise WorkerError(" ".join(part for part in parts if part)) from None


def _part(worker: Worker, keep: Snapshot) -> None:
    """Have the worker's state kept before it is ended, unless that takes too long."""
    end = time.monotonic() + FAREWELL
    with suppress(WorkerError):
        worker.send({"do": "stop"})
        while not (frame := worker.receive(max(0.0, end - time.monotonic()))).header.get("done"):
            if SNAPSHOT in frame.blobs:
                keep.write(frame.blobs[SNAPSHOT])


class _Tally:
    """Progress of populations, side by side or in turn, as if they were one."""

    def __init__(self, populations: int) -> None:
        self._populations = populations
        self._running: dict[int, TrainingProgress] = {}
        self._done = 0
        self._fitness: dict[str, float | None] = {}

    def add(self, number: int, progress: TrainingProgress) -> TrainingProgress:
        """Epochs add up over the populations; the rate is that of all that are under way."""
        self._running[number] = progress
        self._fitness |= progress.fitness
        return TrainingProgress(
            epoch=self._done * progress.epochs + sum(part.epoch for part in self._running.values()),
            epochs=self._populations * progress.epochs,
            env_steps_per_second=sum(part.env_steps_per_second for part in self._running.values()),
            fitness=dict(self._fitness),
        )

    def close(self, number: int) -> None:
        """The population has its results."""
        self._running.pop(number, None)
        self._done += 1


def _interleave(streams: Sequence[Generator[T | None]]) -> Generator[T]:
    """What the streams yield, as it comes; None means that a stream has nothing yet. All of them end together."""
    running = list(streams)
    try:
        while running:
            for stream in tuple(running):
                try:
                    item = next(stream)
                except StopIteration:
                    running.remove(stream)
                    continue
                if item is not None:
                    yield item
    finally:
        for stream in running:
            stream.close()


def _split(jobs: Sequence[TrainJob], groups: int) -> Iterator[Sequence[TrainJob]]:
    """`jobs` in at most `groups` parts; nothing when there are none."""
    size = max(1, -(-len(jobs) // groups))
    return (jobs[i : i + size] for i in range(0, len(jobs), size))


def _deal(jobs: Sequence[TrainJob], kept: Sequence[Sequence[str]], count: int) -> list[Sequence[TrainJob]]:
    """About `count` populations. What a snapshot was taken of stays together: no other population can go on from it."""
    left = {job.id: job for job in jobs}
    together = [[left.pop(name) for name in names] for names in kept if left.keys() >= set(names)]
    return [*together, *_split(list(left.values()), max(1, count - len(together)))]


def _failed(job: TrainJob, reason: str) -> TrainingResult:
    return TrainingResult(
        job=job.id, state=TrainingState.FAILED, fitness=None, curves={}, env_steps=0, seconds=0.0, message=reason
    )
