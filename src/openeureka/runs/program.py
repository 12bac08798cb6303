"""A Python program as the host of a run: it is told events, and nothing is printed but how to go on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from .. import events
from ..config import RunConfig
from ..errors import Interrupted
from ..method.person import Desk
from ..parsing import short_path
from ..report.filming import Filming
from ..store import has_begun
from ..store.directory import is_asked_to_stop
from ..types import Generation, TrainingResult, Usage
from . import compose
from .run import Run


@dataclass(frozen=True, slots=True)
class Started:
    """The run has its directory; what earlier processes left there is kept."""

    run: Run


Event = Started | events.Event
"""What a program is told: first `Started`, then every event of the run."""

Tell = Callable[[Event], object]
Work = Callable[[compose.Host], object]


@dataclass(frozen=True, slots=True)
class Program:
    """A Python program as the host of a run (see `compose.Host`): it is told events, and nothing is printed.

    Signals reach only the main thread. A run in another thread stops when `leaving` is set or `eureka stop` asks for
    it. It checks both at its events, and while it waits for a person.
    """

    tell: Tell
    leaving: threading.Event | None = None
    """None in the main thread."""
    own: bool = False
    """Whether the model is an object, which a store does not hold."""

    def begins(self, config: RunConfig, directory: Path) -> None: ...

    def working(self, text: str) -> AbstractContextManager[None]:
        return nullcontext()

    @contextmanager
    def view(self, config: RunConfig, directory: Path, usage: Usage) -> Iterator[events.Tell]:
        def tell(event: Event) -> None:
            self.tell(event)
            if not isinstance(event, TrainingResult):  # the next result may be there, and must be stored first
                self.obey(directory)

        tell(Started(Run(directory)))
        yield tell

    def obey(self, directory: Path) -> None:
        """Raises KeyboardInterrupt where the run is to stop, in a thread that no signal reaches."""
        if self.leaving is not None and (self.leaving.is_set() or is_asked_to_stop(directory)):
            raise KeyboardInterrupt

    def desk(self, config: RunConfig, directory: Path, films: Sequence[Filming]) -> Desk:
        return _Desk(self, directory)

    def again(self, directory: Path) -> str:
        return f"openeureka.open_run({str(short_path(directory))!r}).resume({'model=...' if self.own else ''})"


@dataclass(frozen=True, slots=True)
class _Desk:
    """Nobody sits here; `eureka feedback` and the page reach the run all the same."""

    host: Program
    directory: Path

    def invite(self, generation: Generation) -> None: ...

    def listen(self, seconds: float) -> None:
        time.sleep(seconds)
        self.host.obey(self.directory)


def host(on_event: Tell | None, *, own: bool = False) -> compose.Host:
    """This program, as the host of runs that it waits for."""
    in_main = threading.current_thread() is threading.main_thread()
    return Program(on_event or (lambda event: None), None if in_main else threading.Event(), own)


def done(directory: Path, on_event: Tell | None, work: Work, *, own: bool = False) -> Run:
    """Do the work, and return the run as far as it came."""
    try:
        work(host(on_event, own=own))
    except Interrupted as stop:
        if not has_begun(directory):
            raise KeyboardInterrupt from None
        print(stop)
    return Run(directory)


def followed(work: Work, *, own: bool) -> Generator[Event]:
    """The events of a run that works in a separate thread."""
    told: SimpleQueue[Event | None] = SimpleQueue()
    leaving = threading.Event()
    failures: list[BaseException] = []

    def run() -> None:
        try:
            work(Program(told.put, leaving, own))
        except BaseException as error:  # raised again in the thread that reads the events
            failures.append(error)
        finally:
            told.put(None)

    thread = threading.Thread(target=run, name="openeureka", daemon=True)
    thread.start()
    try:
        while (event := told.get()) is not None:
            yield event
    except KeyboardInterrupt:
        pass  # `work` ends by Interrupted then, which says how to go on
    finally:
        leaving.set()
        thread.join()
    for failure in failures:
        if not isinstance(failure, Interrupted):
            raise failure
        print(failure)
