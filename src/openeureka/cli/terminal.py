"""The terminal as the host of a run: what it prints while the run works, and what a person types while it waits."""

from __future__ import annotations

import ctypes
import io
import os
import select
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, redirect_stdout
from pathlib import Path

from ..config import NO_MODEL, RunConfig, short_name
from ..display.live import PlainView, TerminalView, view
from ..display.progress import working
from ..errors import FeedbackError
from ..numbers import columns, duration, number
from ..parsing import command_line, short_path
from ..report.filming import Filming
from ..report.view import VIDEO
from ..store import artifacts, say
from ..store.remarks import typed
from ..text import one_line, plain
from ..types import Generation, RemarkKind, Usage, lane_id

CONTROL = "model=random draws rewards at random and reads no results or feedback. It is the control for a real model."


@contextmanager
def aside() -> Iterator[None]:
    """Send to stderr what a task prints, from Python or from a library in C, so that stdout holds the answer alone."""
    with redirect_stdout(sys.stderr):
        if None in (sys.__stdout__, sys.__stderr__):  # started with one of them closed
            yield
            return
        kept = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            ctypes.CDLL(None).fflush(None)  # what C still holds back would come out on stdout later
            os.dup2(kept, 1)
            os.close(kept)


@contextmanager
def trying_out() -> Iterator[None]:
    """While a task is tried, which takes minutes where it is slow: a clock for a person at a terminal. Elsewhere stderr
    holds nothing but what went wrong."""
    with aside(), working("Trying the task out") if sys.stderr.isatty() else nullcontext():
        yield


class Terminal:
    """See `runs.compose.Host`.

    Args:
        advice: printed before all else, but only when nothing has refused the run and work on it begins.
    """

    def __init__(self, advice: str = "") -> None:
        self._advice = advice

    def _advise(self) -> None:
        if self._advice:
            print(plain(self._advice))
        self._advice = ""

    def begins(self, config: RunConfig, directory: Path) -> None:
        self._advise()
        task, place = short_name(config.env), short_path(directory)
        if config.model == NO_MODEL and config.tune:
            print(f"{task}: {config.tune} trainings fit the numbers of a reward, in {place}")
            return
        if config.model == NO_MODEL:
            print(f"{task}: given rewards, in {place}")
            return
        size = f"{config.iteration} generation{'s' * (config.iteration > 1)} of {config.sample} rewards"
        print(f"{task}: {size}, written by model={one_line(config.model)}, in {place}")
        if config.model == "random":
            print(CONTROL)

    def working(self, text: str) -> AbstractContextManager[None]:
        self._advise()
        return working(text)

    def view(self, config: RunConfig, directory: Path, usage: Usage) -> PlainView | TerminalView:
        return view(config, usage)

    def desk(self, config: RunConfig, directory: Path, films: Sequence[Filming]) -> TerminalDesk:
        return TerminalDesk(directory, config, films)

    def again(self, directory: Path) -> str:
        return command_line("resume", directory)


class TerminalDesk:
    """Speaks on stdout, and listens on stdin where that is a terminal."""

    def __init__(self, directory: Path, config: RunConfig, films: Sequence[Filming]) -> None:
        self._directory, self._config, self._films = directory, config, films
        self._listening = sys.stdin is not None and sys.stdin.isatty()
        if self._listening and isinstance(sys.stdin, io.TextIOWrapper):
            sys.stdin.reconfigure(errors="replace")  # a key that the locale cannot read must not end the run

    def invite(self, generation: Generation) -> None:
        for films in self._films:
            films.wait()
        while self._typed_within(0):  # typed before there was anything to watch: words count, an Enter does not
            self._hear(sys.stdin.readline(), go=False)
        print("\n".join(self._invitation(generation)), flush=True)

    def _invitation(self, generation: Generation) -> Iterator[str]:
        table = [("candidate", "F", "video"), *self._videos(generation)]
        if self._config.video == "none":
            yield f"\nGeneration {generation.index} is trained. With video=none, no policies are filmed:"
            yield columns([row[:2] for row in table])
        else:
            yield f"\nGeneration {generation.index} is trained. Watch its policies:"
            yield columns(table)
        yield "Say what you see, in words for the model or by favourite=, veto= and vote=A:B, from any shell:"
        yield f'  {command_line("feedback", self._directory)} "too jerky" favourite=g{generation.index}s0 go'
        if self._listening:
            yield "or here, one line at a time; an empty line continues the run."
        if self._config.feedback_timeout:
            yield f"Without `go` the run continues after {duration(self._config.feedback_timeout)}."

    def _videos(self, generation: Generation) -> Iterator[tuple[str, str, str]]:
        for entry in generation.entries:
            if entry.result is not None:
                video = f"lanes/{lane_id(entry.candidate_id, self._config.seed)}/{VIDEO}"
                shown = str(short_path(self._directory / video)) if artifacts.exists(self._directory, video) else "none"
                yield str(entry.sample.place), number(entry.score), shown

    def listen(self, seconds: float) -> None:
        if self._typed_within(seconds):
            self._hear(sys.stdin.readline())

    def _typed_within(self, seconds: float) -> bool:
        """Whether there is a line for this process to read. Takes the whole time if there is none."""
        if not (self._listening and _in_front()):
            time.sleep(seconds)
            return False
        return bool(select.select([sys.stdin], [], [], seconds)[0])

    def _hear(self, line: str, *, go: bool = True) -> None:
        if not line:  # Ctrl-D: nothing more comes from this keyboard, but it may from other shells
            self._listening = False
            return
        try:
            say(self._directory, *(said for said in typed(line) if go or said.kind is not RemarkKind.GO))
        except FeedbackError as error:
            print(plain(str(error)))


def _in_front() -> bool:
    """Whether this process is in the foreground: a background job that reads the terminal would be stopped."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:  # a terminal without job control
        return True
