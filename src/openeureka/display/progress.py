"""One line that says how far a training is."""

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
"""Each pause is longer than the one before, so that a log stays short."""
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
        """Who read this has ended, such as `head` or `tee`: a search goes on without them, where rich would exit."""
        self.quiet = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def standard() -> Console:
    """Standard output: a terminal or none, whatever FORCE_COLOR says, which some set where a log is kept."""
    return _Standard(force_terminal=None if sys.stdout is not None and sys.stdout.isatty() else False)


def redraws(console: Console) -> bool:
    """Whether lines that stand there can be replaced; on a terminal that cannot, rich would show nothing of them."""
    return console.is_terminal and not console.is_dumb_terminal


@contextmanager
def working(text: str, console: Console | None = None) -> Iterator[None]:
    """Say what is being done that shows no progress of its own: with a clock on a terminal, once elsewhere."""
    console = console or standard()
    if redraws(console):
        with console.status(_Clock(text)):
            yield
    else:
        console.print(Text(text), soft_wrap=True)
        yield


class ProgressLine:
    """A new line now and then, for where none can be redrawn."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._since: tuple[float, int] | None = None
        """When the training that is shown was first heard of, and its epochs then, as `_left` counts them."""
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
        """[s] to its end, at the pace of the epochs heard of; after an earlier epoch it is another training, and where
        fewer are known to have been done before, another stage of a curriculum."""
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
