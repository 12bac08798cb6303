"""The console that a run prints to, and the lines by which it says what it does and how far a training is."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.text import Text

from ..numbers import duration, number
from ..text import one_line
from ..types import TrainingProgress

SECONDS_BETWEEN_LINES = 10.0
"""[s] The first pause. Each pause is `LONGER` times the one before, up to `LONGEST`, so that a log stays short."""
LONGER, LONGEST = 1.5, 600.0
SHOWN = 3
"""Lanes named in the line."""


class _Clock:
    """A text with the time since it was first shown."""

    def __init__(self, text: str) -> None:
        self._text, self._started = text, time.monotonic()

    def __rich__(self) -> Text:
        return Text(f"{self._text}, {duration(time.monotonic() - self._started)}")


class _Standard(Console):
    def on_broken_pipe(self) -> None:
        """The reader, such as `head` or `tee`, has ended: the search goes on without it, where rich would exit."""
        self.quiet = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def standard() -> Console:
    """Standard output. FORCE_COLOR does not make it a terminal, because some people set it where they keep a log."""
    return _Standard(force_terminal=None if sys.stdout is not None and sys.stdout.isatty() else False)


def redraws(console: Console) -> bool:
    """Whether printed lines can be redrawn; on a terminal that cannot do that, rich would show nothing of them."""
    return console.is_terminal and not console.is_dumb_terminal


@contextmanager
def working(text: str, console: Console | None = None) -> Iterator[None]:
    """Say what is being done while it shows no progress itself: with a clock on a terminal, once elsewhere."""
    console = console or standard()
    if redraws(console):
        with console.status(_Clock(text)):
            yield
    else:
        console.print(Text(text), soft_wrap=True)
        yield


class ProgressLine:
    """The progress of a training as a new line now and then, where lines cannot be redrawn."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._since: tuple[float, int] | None = None
        """Time of the training's first event [s], and its epochs then, without those that an earlier process did."""
        self._counted = self._resumed = 0
        self._printed, self._pause = 0.0, SECONDS_BETWEEN_LINES

    def show(self, progress: TrainingProgress) -> None:
        text = self._sentence(progress)
        now = time.monotonic()
        if now - self._printed >= self._pause:
            self._console.print(Text(text), soft_wrap=True)
            self._pause = min(LONGEST, self._pause * LONGER) if self._printed else self._pause
            self._printed = now

    def _sentence(self, progress: TrainingProgress) -> str:
        left = self._left(progress)
        scores = [(fitness, lane) for lane, fitness in progress.fitness.items() if fitness is not None]
        best = ", ".join(f"{lane} {number(fitness)}" for fitness, lane in sorted(scores, reverse=True)[:SHOWN])
        nodes = by_node(progress)
        return (
            f"Training: epoch {progress.epoch} of {progress.epochs}, "
            f"{progress.env_steps_per_second:,.0f} steps/s, "
            f"{duration(left) + ' left' if left is not None else 'starting'}"
            + (f"; best F: {best}" if best else "")
            + (f"; {nodes}" if nodes else "")
        )

    def _left(self, progress: TrainingProgress) -> float | None:
        """[s] to the end of the training, at the pace of its epochs in this process.

        The epoch falls where another training begins; the number of resumed epochs falls where another stage of a
        curriculum begins. In both cases the pace is measured anew.
        """
        now, counted = time.monotonic(), progress.epoch - progress.resumed
        if self._since is None or counted < self._counted or progress.resumed < self._resumed:
            self._since = now, counted
        self._counted, self._resumed = counted, progress.resumed
        began, first = self._since
        done = counted - first
        return (now - began) / done * (progress.epochs - progress.epoch) if done else None


def by_node(progress: TrainingProgress) -> str:
    """What each node of a cluster trains, and how fast; empty on one machine."""
    return ", ".join(
        f"{one_line(name, 40)} {share.lanes} lanes at {share.env_steps_per_second:,.0f} steps/s"
        for name, share in sorted(progress.nodes.items())
    )
