"""How a run at work is stopped, hears of it, and says how to go on."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from ..errors import Interrupted, StoreError
from ..store import Store
from ..store.directory import is_asked_to_stop, withdraw

_STOPPING = "Stopping: what is trained is being kept, for up to ten seconds or an epoch. Ctrl-C again does not wait."
POLL = 0.5
"""[s] between two looks at whether the run is to stop."""


@contextmanager
def continuable(again: str, store: Store) -> Iterator[None]:
    """Have whatever ends a run say what to write to go on with it."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(stopped(again)) from None
    except Exception as error:  # a programming error stays loud; those of a person's own model or task are many
        said = "What is done is kept. Continue" if _holds_work(store) else "Nothing is done yet. Try again"
        error.add_note(f"{said} with: {again}")
        raise


def _holds_work(store: Store) -> bool:
    try:
        return bool(store.lanes.all() or store.talk.replies())
    except StoreError:  # may be what ended the run
        return True


def stopped(again: str = "") -> str:
    """Of a run that was stopped on purpose, and the command that goes on with it; empty where only its own does."""
    return f"Stopped, nothing is lost. Continue {f'with: {again}' if again else 'as you began it.'}"


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handles a signal: says that it was heard, and raises KeyboardInterrupt."""
    # What is printed right now may be in the middle of a line, and must not be entered twice.
    with suppress(RuntimeError):
        try:
            print(_STOPPING, flush=True)
        except OSError:  # Ctrl-C has ended who reads this, such as `tee`: the way on is told on the other stream
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    signal.default_int_handler(number, frame)


@contextmanager
def announced() -> Iterator[None]:
    """In the main thread: say at once that Ctrl-C was heard. Keeping a training under way takes some seconds."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # a shell's background process ignores it
        yield
        return

    def once(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, before)
        interrupt(number, frame)

    signal.signal(signal.SIGINT, once)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def stoppable(directory: Path) -> Iterator[None]:
    """In the main thread: raise KeyboardInterrupt, as Ctrl-C does, when the run is asked to stop.

    SIGINT itself would not do: shells have processes in the background ignore it. No signal reaches another thread;
    there the host stops the run.
    """
    withdraw(directory)
    if threading.current_thread() is not threading.main_thread():
        try:
            yield
        finally:
            withdraw(directory)
        return
    over, listener = threading.Event(), threading.get_ident()

    def watch() -> None:
        while not over.wait(POLL):
            if is_asked_to_stop(directory):
                signal.pthread_kill(listener, signal.SIGUSR1)
                return

    before = signal.signal(signal.SIGUSR1, interrupt)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        with announced():
            yield
    finally:
        over.set()
        watcher.join()
        signal.signal(signal.SIGUSR1, before)
        withdraw(directory)
