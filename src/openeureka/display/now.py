"""`run.now.json`: what a run is doing now, for its page, in a small file that is replaced every few seconds.

The store holds what is finished. Nobody needs the curves of lanes that still train, or the time left, once the run has
ended: then the file is deleted.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from ..codec import DecodeError, decode, encode, to_finite
from ..config import RunConfig
from ..errors import StoreError
from ..events import Asked, Began, Event, Replied
from ..store import artifacts
from ..store.db import NOW
from ..types import NodeShare, TrainingProgress, Usage
from ..types.bounds import Count, Finite, Name
from .tally import Tally

PAUSE = 2.0
"""Least time between two writes while a training goes on [s]."""
MOST = 80
"""Most points of a curve. When there are more, every second one is dropped, and new ones come at twice the distance."""

Curves = Mapping[Name, tuple[Finite | None, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Now:
    """What a run is doing."""

    doing: str
    """In words."""
    seconds: Finite
    """[s] since the process began."""
    left: Finite | None
    """[s] until the search ends; None before the first generation is done, and after the last."""
    writing: Count = 0
    """Number of slots that the model is writing for."""
    usage: Usage = field(default_factory=Usage)
    epoch: Count = 0
    epochs: Count = 0
    env_steps_per_second: Finite = 0.0
    nodes: Mapping[Name, NodeShare] = field(default_factory=dict[str, NodeShare])
    at_epochs: tuple[Count, ...] = ()
    """Epochs of the values in `curves`."""
    curves: Mapping[Name, Curves] = field(default_factory=dict[str, Curves])
    """By lane id, for lanes that train: `fitness`, `reward` and each `component/<name>`."""


def read(directory: Path) -> Now | None:
    """What a run is doing; None where there is no file, or not a valid one: it may come from anybody."""
    try:
        data = artifacts.read(directory, NOW)
        if data is None:
            return None
        return decode(Now, data)
    except (DecodeError, StoreError):
        return None


_NOT_BEGUN = TrainingProgress(epoch=0, epochs=0, env_steps_per_second=0.0, fitness={})


class Recorder:
    """Writes the file at events. A full disk does not end the search here: the store will report it."""

    def __init__(self, directory: Path, config: RunConfig, usage: Usage) -> None:
        self._directory = directory
        self._tally = Tally(config, usage)
        self._asked: set[int] = set()
        self._written = 0.0
        self._clear()

    def _clear(self) -> None:
        self._progress = _NOT_BEGUN
        self._epochs: list[int] = []
        self._curves: dict[str, dict[str, list[float | None]]] = {}
        self._apart = 1

    def __call__(self, event: Event) -> None:
        self._tally.hear(event)
        match event:
            case Began():
                self._asked.clear()
                self._clear()
                self._write()
            case Asked(slots):
                self._asked = set(slots)
                self._write()
            case Replied(slot=slot):
                self._asked.discard(slot)
                self._write()
            case TrainingProgress():
                self._follow(event)
            case _:
                pass

    def _follow(self, progress: TrainingProgress) -> None:
        if progress.epoch < self._progress.epoch:
            self._clear()  # another training has begun, as in each round of the race
        self._progress = progress
        if not self._epochs or progress.epoch - self._epochs[-1] >= self._apart:
            self._add(progress)
        if time.monotonic() - self._written >= PAUSE:
            self._write()

    def _add(self, progress: TrainingProgress) -> None:
        """Add a value to each curve. A curve that begins late has None before that."""
        if len(self._epochs) >= MOST:
            self._apart = max(1, 2 * (self._epochs[-1] - self._epochs[0]) // len(self._epochs))
            del self._epochs[1::2]
            for curves in self._curves.values():
                for values in curves.values():
                    del values[1::2]
        newest = {lane: {"fitness": best, **progress.latest.get(lane, {})} for lane, best in progress.fitness.items()}
        for lane, values in newest.items():
            for name, value in values.items():
                curve = self._curves.setdefault(lane, {}).setdefault(name, [])
                curve += [None] * (len(self._epochs) - len(curve)) + [value]
        self._epochs.append(progress.epoch)

    def _write(self) -> None:
        self._written = time.monotonic()
        count = len(self._epochs)
        now = Now(
            doing=self._tally.doing,
            seconds=self._written - self._tally.started,
            left=self._tally.remaining(),
            writing=len(self._asked),
            usage=self._tally.usage,
            epoch=self._progress.epoch,
            epochs=self._progress.epochs,
            env_steps_per_second=self._progress.env_steps_per_second,
            nodes=self._progress.nodes,
            at_epochs=tuple(self._epochs),
            curves={
                lane: {name: (*values, *[None] * (count - len(values))) for name, values in curves.items()}
                for lane, curves in self._curves.items()
            },
        )
        with suppress(StoreError):
            artifacts.write(self._directory, NOW, encode(to_finite(now)))
