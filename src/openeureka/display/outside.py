"""What a run leaves for those who look at its directory or page, and not at its terminal: lines on how it went, and
what it is doing now, in a small file that is replaced every few seconds.

A store holds what is finished. Curves of lanes that still train, and the time left, interest nobody once the run is
over; the file goes with it.
"""

from __future__ import annotations

import io
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from rich.console import Console

from ..codec import DecodeError, decode, defined, encode
from ..config import RunConfig
from ..errors import EurekaError, StoreError
from ..events import Asked, Began, Event, Replied, Tell
from ..store import artifacts
from ..store.db import LOG, NOW
from ..text import plain
from ..types import Generation, NodeShare, TrainingProgress, Usage
from ..types.bounds import Count, Finite, Name
from .live import PlainView, Tally

WIDTH = 120
PAUSE = 2.0
"""[s] between two writings while a training goes on."""
MOST = 80
"""Points kept of a curve; of a longer one every second goes, and those to come are that much farther apart."""


class _LogFile(io.TextIOWrapper):
    """Says nothing of a full disk: a search does not stop for its log, and the store will speak of it."""

    def write(self, text: str) -> int:
        with suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            super().flush()

    def close(self) -> None:
        with suppress(OSError):
            super().close()


@contextmanager
def logged(directory: Path, config: RunConfig, usage: Usage) -> Iterator[list[Tell]]:
    """Listeners that keep what the run is doing while it is at work, and write `run.log`, where that can be written and
    the process does not print to it already."""
    recorder = Recorder(directory, config, usage)
    try:
        with _lines(directory, config, usage) as lines:
            yield [recorder, *lines]
    finally:
        with suppress(StoreError):
            artifacts.remove(directory, NOW)


@contextmanager
def _lines(directory: Path, config: RunConfig, usage: Usage) -> Iterator[list[Tell]]:
    raw = _opened(directory)
    if raw is None:
        yield []
        return
    with _LogFile(raw, encoding="utf-8") as file:
        try:
            yield [PlainView(Console(file=file, width=WIDTH, force_terminal=False), config, usage)]
        except EurekaError as error:
            print(plain(str(error)), file=file)
            raise
        except KeyboardInterrupt:
            print("Stopped", file=file)
            raise


def _opened(directory: Path) -> BinaryIO | None:
    try:
        file = artifacts.appended(directory, LOG)
    except (OSError, StoreError):
        return None
    with suppress(OSError):  # no stdout
        if os.path.samestat(os.fstat(1), os.fstat(file.fileno())):  # as the page starts runs
            file.close()
            return None
    return file


Curves = Mapping[Name, tuple[Finite | None, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Now:
    """What a run is doing."""

    doing: str
    """In words."""
    generation: Count
    seconds: Finite
    """[s] since the process began."""
    left: Finite | None
    """[s] of the search that are left; None before the first generation is done, and after the last."""
    writing: Count = 0
    """Slots that the model writes for."""
    usage: Usage = field(default_factory=Usage)
    epoch: Count = 0
    epochs: Count = 0
    env_steps_per_second: Finite = 0.0
    nodes: Mapping[Name, NodeShare] = field(default_factory=dict[str, NodeShare])
    places: tuple[Count, ...] = ()
    """Epochs of the values in `curves`."""
    curves: Mapping[Name, Curves] = field(default_factory=dict[str, Curves])
    """By lane id, those under way: F, `reward` and each `component/<name>`."""


def read(directory: Path) -> Now | None:
    """What a run is doing; None where it does not say, or what is there is no such thing: it may come from anybody."""
    try:
        data = artifacts.read(directory, NOW)
        return decode(Now, data) if data is not None else None
    except (DecodeError, StoreError):
        return None


class Recorder:
    """Keeps the file. A search does not stop for it where the disk is full: the store will speak of that."""

    def __init__(self, directory: Path, config: RunConfig, usage: Usage) -> None:
        self._directory = directory
        self._tally = Tally(config, usage)
        self._asked: set[int] = set()
        self._written = 0.0
        self._clear()

    def _clear(self) -> None:
        self._progress: TrainingProgress | None = None
        self._places: list[int] = []
        self._curves: dict[str, dict[str, list[float | None]]] = {}
        self._apart = 1

    def __call__(self, event: Event) -> None:
        match event:
            case Began(generation, phase):
                self._tally.phase(generation, phase)
                self._asked.clear()
                self._clear()
                self._write()
            case Asked(slots):
                self._asked = set(slots)
                self._write()
            case Replied(slot=slot, reply=reply):
                self._tally.usage += reply.usage
                self._asked.discard(slot)
                self._write()
            case TrainingProgress():
                self._follow(event)
            case Generation():
                self._tally.generation_done(event)
            case _:
                pass

    def _follow(self, progress: TrainingProgress) -> None:
        if self._progress is not None and progress.epoch < self._progress.epoch:
            self._clear()  # other lanes have begun, as in each round of the final trainings
        self._progress = progress
        if not self._places or progress.epoch - self._places[-1] >= self._apart:
            self._add(progress)
        if time.monotonic() - self._written >= PAUSE:
            self._write()

    def _add(self, progress: TrainingProgress) -> None:
        """A value of each curve; one that begins late has none before."""
        if len(self._places) >= MOST:
            self._apart = max(1, 2 * (self._places[-1] - self._places[0]) // len(self._places))
            del self._places[1::2]
            for curves in self._curves.values():
                for values in curves.values():
                    del values[1::2]
        newest = {lane: {"fitness": best, **progress.latest.get(lane, {})} for lane, best in progress.fitness.items()}
        for lane, values in newest.items():
            for name, value in values.items():
                curve = self._curves.setdefault(lane, {}).setdefault(name, [])
                curve += [None] * (len(self._places) - len(curve)) + [value]
        self._places.append(progress.epoch)

    def _write(self) -> None:
        self._written, made = time.monotonic(), self._progress
        count = len(self._places)
        now = Now(
            doing=self._tally.doing,
            generation=self._tally.index,
            seconds=self._written - self._tally.started,
            left=self._tally.remaining(),
            writing=len(self._asked),
            usage=self._tally.usage,
            epoch=made.epoch if made else 0,
            epochs=made.epochs if made else 0,
            env_steps_per_second=made.env_steps_per_second if made else 0.0,
            nodes=made.nodes if made else {},
            places=tuple(self._places),
            curves={
                lane: {name: (*values, *[None] * (count - len(values))) for name, values in curves.items()}
                for lane, curves in self._curves.items()
            },
        )
        with suppress(StoreError):
            artifacts.write(self._directory, NOW, encode(defined(now)))
