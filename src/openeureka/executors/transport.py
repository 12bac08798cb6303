"""How a request reaches a worker and its answers come back: here, one child process of this machine per request.

An executor on other machines brings its own `Transport`; `scheduler` and `retry` see no other difference.
"""

from __future__ import annotations

import math
import os
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from multiprocessing import connection
from typing import NamedTuple, Protocol, TypeVar

from ..errors import EurekaError, TaskError, WorkerError
from ..worker import LESS_MEMORY, Frame, Worker, WorkerDied, WorkerTimeout

SILENCE = 600.0
"""[s] without a sign of life after which a worker counts as hung; it gives one a second, but compiles for seconds."""
LOOK = 10.0
"""[s] between two looks at silent workers. Where a look comes this much too late, this process was itself suspended, as
by `docker pause`, and cannot tell how long a worker has been silent."""
FAREWELL, LONGEST_FAREWELL = 10.0, 100.0
"""[s] that a worker may take for a last snapshot when a training is stopped: the first as a rule, the second with long
epochs. It notices the stop once an epoch, or once a second. Slurm, as the guide to clusters sets it, kills after two
minutes."""
_NO_MEMORY = re.compile(r"allocate memory|MemoryError|bad_alloc|failed to map segment")
"""What Python, torch, MuJoCo and the loader of libraries say where the address space is limited."""


class Seat(NamedTuple):
    """Room for one worker."""

    device: str
    threads: int
    """Simulation and tensor threads; 0 for all cores."""


class WorkerLost(WorkerError):
    """The machine of a worker is gone: nothing that was asked of it is at fault."""


class Call(Protocol):
    """One request under way."""

    def receive(self) -> Frame:
        """The next frame; the last one's header says `done`.

        Raises:
            WorkerError: when the worker died or hangs, WorkerLost when its machine did. The call must then be closed.
            TaskError: when the task's own code fails there.
        """
        ...

    def stop(self) -> None:
        """Ask to end now, with a snapshot."""
        ...

    def close(self) -> None:
        """End the worker, whatever it does; safe to call twice."""
        ...


AnyCall = TypeVar("AnyCall", bound=Call)


class Transport(Protocol[AnyCall]):
    """Where requests are served."""

    def call(self, request: Frame, seat: Seat) -> AnyCall:
        """Send a request. A worker that cannot be reached counts as dead: `receive` raises that."""
        ...

    def wait(self, calls: Sequence[AnyCall], timeout: float | None = None) -> Sequence[AnyCall]:
        """The calls whose `receive` returns or raises at once, as soon as there are any; none after `timeout` [s]."""
        ...


class Processes:
    """A `Transport` that starts a process for each call, and ends it with the call.

    Args:
        module: what the process runs, see `child`.
        silence: [s] after which a process that says nothing counts as hung.
    """

    def __init__(self, module: str, silence: float = SILENCE) -> None:
        self._module, self._silence = module, silence

    def call(self, request: Frame, seat: Seat) -> ProcessCall:
        # Idle OpenMP threads that spin would starve the simulator's threads, many times over on a busy machine.
        worker = Worker(self._module, env={"GOMP_SPINCOUNT": "0", **os.environ}, nice=0)
        try:
            worker.send({**request.header, **seat._asdict()}, request.blobs)
        except WorkerDied:
            pass  # `receive` tells how it ended
        except BaseException:
            worker.close()
            raise
        return ProcessCall(worker, self._silence)

    @staticmethod
    def wait(calls: Sequence[ProcessCall], timeout: float | None = None) -> Sequence[ProcessCall]:
        end = math.inf if timeout is None else time.monotonic() + timeout
        while True:
            found = [call for call in calls if call.ready]
            began = time.monotonic()
            left = min([end - began, *(call.patience for call in calls)])
            if found or left <= 0:
                return found
            connection.wait([call.worker.fileno() for call in calls], min(left, LOOK))
            if time.monotonic() - began > min(left, LOOK) + LOOK:
                for call in calls:
                    call.forgive()


class ProcessCall:
    """A `Call` that its own process serves."""

    def __init__(self, worker: Worker, silence: float) -> None:
        self.worker = worker
        self._silence, self._heard = silence, time.monotonic()

    @property
    def patience(self) -> float:
        """[s] that the process may still be silent."""
        return self._heard + self._silence - time.monotonic()

    @property
    def ready(self) -> bool:
        return self.patience <= 0 or self.worker.ready(0.0)

    def forgive(self) -> None:
        """Count the silence anew: this process was suspended for a while, and perhaps the worker was, too."""
        self._heard = time.monotonic()

    def receive(self) -> Frame:
        Processes.wait([self])
        try:
            # A frame that is there is read, even after this process was suspended.
            frame = self.worker.receive(self._silence if self.worker.ready(0.0) else 0.0)
        except (WorkerDied, WorkerTimeout) as error:
            ending = self.worker.ending() if isinstance(error, WorkerDied) else ""
            words = self.worker.last_words()
            advice = f"Raise `ulimit -v`, or {LESS_MEMORY}." if _NO_MEMORY.search(words) else ""
            parts = (f"Training stopped: {error}", ending, words, advice)
            raise WorkerError(" ".join(filter(None, parts))) from None
        self._heard = time.monotonic()
        if "broken" in frame.header:
            raise TaskError(frame.header["broken"])
        return frame

    def stop(self) -> None:
        with suppress(WorkerDied):
            self.worker.send({"do": "stop"})

    def close(self) -> None:
        self.worker.close()


def farewell(transport: Transport[AnyCall], calls: Mapping[AnyCall, float]) -> Iterator[tuple[AnyCall, Frame]]:
    """Stop the calls, all at once; yields the frames that each still sends within its time [s]."""
    began = time.monotonic()
    left = {call: began + seconds for call, seconds in calls.items()}
    for call in left:
        call.stop()
    while left:
        ready = transport.wait(list(left), max(0.0, min(left.values()) - time.monotonic()))
        for call in ready:
            try:
                frame = call.receive()
            except EurekaError:
                del left[call]
                continue
            if frame.header.get("done"):
                del left[call]
            yield call, frame
        if not ready:
            left = {call: end for call, end in left.items() if end > time.monotonic()}
