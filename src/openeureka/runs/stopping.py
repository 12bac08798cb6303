"""How a run at work is stopped, and how it then says what continues it."""

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

_STOPPING = "Stopping: trainings are being saved, for up to ten seconds or an epoch. Press Ctrl-C again to skip this."
POLL = 0.5
"""[s] between two looks at whether the run is to stop."""


@contextmanager
def continuable(again: str, store: Store) -> Iterator[None]:
    """Add to whatever ends a run the command that continues it."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(stopped(again)) from None
    except Exception as error:  # also programming errors, as in a person's own model or task
        said = "What is done is kept. Continue" if _holds_work(store) else "Nothing is done yet. Try again"
        error.add_note(f"{said} with: {again}")
        raise


def _holds_work(store: Store) -> bool:
    try:
        return bool(store.lanes.all() or store.talk.replies())
    except StoreError:  # the store itself may have ended the run
        return True


def stopped(again: str = "") -> str:
    """The message for a run that was stopped on purpose.

    Args:
        again: the command that continues it; empty where only the command that began it does.
    """
    return f"Stopped, nothing is lost. Continue {f'with: {again}' if again else 'the way you started it.'}"


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handles a signal: says that it was heard, and raises KeyboardInterrupt."""
    # The signal may have interrupted a print, whose buffer must not be entered twice (RuntimeError).
    with suppress(RuntimeError):
        try:
            print(_STOPPING, flush=True)
        except OSError:  # Ctrl-C also ended the reader, such as `tee`; how to continue goes to stderr
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    signal.default_int_handler(number, frame)


@contextmanager
def announced() -> Iterator[None]:
    """In the main thread: confirm Ctrl-C at once, because saving a training under way takes some seconds."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # a shell's background process ignores SIGINT
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

    SIGINT itself would not do: a shell's background processes ignore it. In another thread, which no signal reaches,
    the host stops the run.
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
