"""A Python program as the host of a run: it hears events, and nothing is printed but how to go on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from ..config import RunConfig
from ..errors import Interrupted
from ..method.person import Desk
from ..observer import Phase
from ..report.filming import Filming
from ..score import Outcome
from ..store import has_begun
from ..store.directory import is_asked_to_stop
from ..types import Evaluation, Generation, Reply, Sample, TrainingProgress, TrainingResult, Usage
from . import compose
from .run import Run


@dataclass(frozen=True, slots=True)
class Started:
    """The run has its directory; what earlier processes left there is kept."""

    run: Run


@dataclass(frozen=True, slots=True)
class Began:
    """A phase begins: of a generation, of a round of `tune` (counted on from the last generation), or of what follows
    both. `feedback` waits for a person."""

    generation: int
    phase: Phase


@dataclass(frozen=True, slots=True)
class Asked:
    """The model begins to write for these slots; some of them for another time."""

    slots: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Replied:
    """A reply arrived and is stored."""

    generation: int
    slot: int
    reply: Reply


@dataclass(frozen=True, slots=True)
class Checked:
    """A slot's newest program was checked; a refused one may be followed by another for the same slot."""

    sample: Sample


@dataclass(frozen=True, slots=True)
class Played:
    """What lanes score by now, by id, since their policies were played; the stored ones come again."""

    scores: Mapping[str, Evaluation]


Event = Started | Began | Asked | Replied | Checked | TrainingProgress | TrainingResult | Played | Generation | Outcome
"""In the order in which it happens, and after it is stored. `TrainingProgress` comes about once a second while lanes
train, a `TrainingResult` when one of them is done, a `Generation` when all of it is, the `Outcome` when a search is."""


class Teller:
    """An observer that makes an event of all it sees."""

    def __init__(self, tell: Callable[[Event], object]) -> None:
        self._tell = tell

    def phase(self, generation: int, name: Phase) -> None:
        self._tell(Began(generation, name))

    def asked(self, slots: Sequence[int]) -> None:
        self._tell(Asked(tuple(slots)))

    def reply(self, generation: int, slot: int, reply: Reply) -> None:
        self._tell(Replied(generation, slot, reply))

    def verdict(self, sample: Sample) -> None:
        self._tell(Checked(sample))

    def progress(self, progress: TrainingProgress) -> None:
        self._tell(progress)

    def result(self, result: TrainingResult) -> None:
        self._tell(result)

    def played(self, scores: Mapping[str, Evaluation]) -> None:
        self._tell(Played(dict(scores)))

    def generation(self, generation: Generation) -> None:
        self._tell(generation)

    def outcome(self, outcome: Outcome) -> None:
        self._tell(outcome)


Tell = Callable[[Event], object]
Work = Callable[[compose.Host], object]


@dataclass(frozen=True, slots=True)
class Program:
    """A Python program as the host of a run (see `compose.Host`): it hears events, and nothing is printed.

    No signal reaches any thread but the main one. A run in another stops where it tells of something, or waits for a
    person: when `leaving` is set, or `eureka stop` asks for it.
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
    def view(self, config: RunConfig, directory: Path, usage: Usage) -> Iterator[Teller]:
        def tell(event: Event) -> None:
            self.tell(event)
            if not isinstance(event, TrainingResult):  # the next one may be waiting: it is to be kept first
                self.obey(directory)

        tell(Started(Run(directory)))
        yield Teller(tell)

    def obey(self, directory: Path) -> None:
        """Raises KeyboardInterrupt where the run is to stop and no signal says so."""
        if self.leaving is not None and (self.leaving.is_set() or is_asked_to_stop(directory)):
            raise KeyboardInterrupt

    def desk(self, config: RunConfig, directory: Path, films: Sequence[Filming]) -> Desk:
        return _Desk(self, directory)

    def again(self, directory: Path) -> str:
        return f"openeureka.open_run({str(directory)!r}).resume({'model=...' if self.own else ''})"


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
    """The run after the work, or as far as it came when it was stopped."""
    try:
        work(host(on_event, own=own))
    except Interrupted as stop:
        if not has_begun(directory):
            raise KeyboardInterrupt from None
        print(stop)
    return Run(directory)


def followed(work: Work, *, own: bool = False) -> Generator[Event]:
    """The events of a run at work in a thread of its own."""
    events: SimpleQueue[Event | None] = SimpleQueue()
    leaving = threading.Event()
    failures: list[BaseException] = []

    def run() -> None:
        try:
            work(Program(events.put, leaving, own))
        except BaseException as error:  # whatever it is, it is raised where somebody looks
            failures.append(error)
        finally:
            events.put(None)

    thread = threading.Thread(target=run, name="openeureka", daemon=True)
    thread.start()
    try:
        while (event := events.get()) is not None:
            yield event
    except KeyboardInterrupt:
        leaving.set()
    finally:
        leaving.set()
        thread.join()
    for failure in failures:
        if not isinstance(failure, Interrupted):
            raise failure
        print(failure)
