"""Runs training in a worker process, so that a crash of the simulator never takes a run down."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..errors import WorkerError
from ..tasks import registry
from ..types import Evaluation, TrainBudget, TrainingProgress, TrainingResult, TrainingState, TrainJob
from ..worker import Frame, Worker, WorkerDied, WorkerTimeout
from .wire import pack_jobs, unpack

SILENCE = 600.0
"""[s] without a sign of life after which a worker counts as hung; it reports every second and compiles for seconds."""
MAX_WORLDS = 16384
"""A world costs about 0.15 MB, of which the model hardly matters (measured on Cartpole and Humanoid)."""


class PopulationTrainer:
    """A `types.Trainer`: the jobs of a call are lanes of one population in one process, or of several in turn when they
    are too many for one simulation.

    Args:
        device: `cpu` (or a device the simulator supports).
        threads: simulation and tensor threads, 0 for all cores.
        max_worlds: the most worlds of one population, over all its lanes.
        silence: [s] after which a worker that says nothing is ended and replaced.
        module: what the worker runs; tests replace it.
    """

    def __init__(
        self,
        device: str = "cpu",
        threads: int = 0,
        *,
        module: str = "openeureka.training.worker",
        silence: float = SILENCE,
        max_worlds: int = MAX_WORLDS,
    ) -> None:
        self._options = {"device": device, "threads": threads}
        self._module, self._silence, self._max_worlds = module, silence, max_worlds

    def train(
        self, env: str, jobs: Sequence[TrainJob], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        """Train every job. A worker that dies or hangs is started again with the jobs that have no result yet, then
        once more for each of them alone; those that die even so are FAILED with the reason.

        Raises:
            TaskError: when there is no such environment.
        """
        recipe = registry.get(env).recipe
        worlds = budget.worlds or recipe.worlds
        size = max(1, self._max_worlds // worlds)
        populations = [jobs[i : i + size] for i in range(0, len(jobs), size)]
        for index, population in enumerate(populations):
            for message in self._train(env, population, budget):
                if isinstance(message, TrainingProgress):
                    before, total = index * message.epochs, len(populations) * message.epochs
                    message = dataclasses.replace(message, epoch=before + message.epoch, epochs=total)
                yield message

    def _train(
        self, env: str, jobs: Sequence[TrainJob], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        left = {job.id: job for job in jobs}
        reasons: dict[str, str] = {}
        # Together, together once more, then one by one: a lane that kills its process takes no other with it.
        for groups in (1, 1, len(jobs)):
            for group in _split(list(left.values()), groups):
                try:
                    for frame in self._ask({"do": "train", **pack_jobs(env, group, budget)}, {}):
                        message = unpack(frame)
                        if isinstance(message, TrainingResult):
                            del left[message.job]
                        yield message
                except WorkerError as error:
                    reasons |= {job.id: str(error) for job in group}
        yield from (_failed(job, reasons[job.id]) for job in left.values())

    def evaluate(self, env: str, policies: Mapping[str, bytes], *, seed: int) -> Iterator[Evaluation]:
        """Held-out score of each policy. Raises WorkerError when the worker dies."""
        if policies:
            for frame in self._ask({"do": "evaluate", "env": env, "seed": seed}, policies):
                yield Evaluation(**frame.header["score"])

    def _ask(self, request: Mapping[str, Any], blobs: Mapping[str, bytes]) -> Iterator[Frame]:
        """Frames of one request, up to the one that says it is done."""
        # Idle OpenMP threads that spin would starve the simulator's threads, many times over on a busy machine.
        with Worker(self._module, env={"GOMP_SPINCOUNT": "0", **os.environ}) as worker:
            try:
                worker.send({**request, **self._options}, blobs)
                while not (frame := worker.receive(self._silence)).header.get("done"):
                    yield frame
            except (WorkerDied, WorkerTimeout) as error:
                last = worker.stderr_tail().splitlines()[-1:]
                raise WorkerError(" ".join([f"Training stopped: {error}", *last])) from None


def _split(jobs: Sequence[TrainJob], groups: int) -> Iterator[Sequence[TrainJob]]:
    """`jobs` in at most `groups` parts; nothing when there are none."""
    size = max(1, -(-len(jobs) // groups))
    return (jobs[i : i + size] for i in range(0, len(jobs), size))


def _failed(job: TrainJob, reason: str) -> TrainingResult:
    return TrainingResult(
        job=job.id, state=TrainingState.FAILED, fitness=None, curves={}, env_steps=0, seconds=0.0, message=reason
    )
