"""Errors a person can cause, each one sentence that says what to do; programming errors are never wrapped."""

from __future__ import annotations

import difflib
import errno
from collections.abc import Iterable


class EurekaError(Exception):
    """Base of every error whose text is meant for a person; the command line prints it and exits with `exit_code`."""

    exit_code = 2


class Interrupted(EurekaError):
    """Ctrl-C."""

    exit_code = 130


class ConfigError(EurekaError):
    """An unknown key, or a value out of range."""


class TaskError(EurekaError):
    """An environment that does not exist or cannot be loaded."""


class CapacityError(TaskError):
    """The GPU simulator had too little room for the contacts of a world."""


class RewardFileError(EurekaError):
    """A reward file that cannot be read or was refused."""


class ModelError(EurekaError):
    """A language model that cannot be reached, loaded or paid."""

    exit_code = 3


class BudgetError(EurekaError):
    """`max_cost` is reached; the run is complete up to here and can be resumed with a higher limit."""

    exit_code = 4


class StoreError(EurekaError):
    """A run directory that cannot be opened or is locked, or a disk that is full."""

    exit_code = 5


class NotBegun(StoreError):
    """A directory in which no run began, or where one was killed before its settings were kept."""


class FeedbackError(EurekaError):
    """Feedback to a run that takes none, or about a candidate that does not exist."""


class SandboxUnavailable(EurekaError):
    """The kernel lacks what confinement needs, or the machine is too busy to check a program."""

    exit_code = 6


class WorkerError(EurekaError):
    """A worker process died or hung more often than is allowed."""

    exit_code = 7


_USED_UP = {errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM}


def lacking(error: OSError) -> str:
    """Which resource the machine lacks or has used up, and what to do; empty for any other error."""
    if error.errno in _USED_UP:
        return (
            f"This machine has run out of processes, open files or memory ({error.strerror}): raise `ulimit -u` and "
            "`ulimit -n` or the container's limits, or use fewer threads=."
        )
    if error.errno == errno.ENOENT and "temporary directory" in str(error.strerror):
        return "There is no writable folder for temporary files: set TMPDIR to one."
    return ""


def told(error: BaseException) -> str:
    """Kind and text of an error, on one line."""
    if isinstance(error, SystemExit):
        return f"sys.exit({error.code!r}) was called; raise an error instead."
    text = " ".join(str(error).split()).rstrip(".")
    return f"{type(error).__name__}: {text}." if text else f"{type(error).__name__}."


def nearest(name: str, known: Iterable[str]) -> str:
    """` Did you mean X?` for the closest known name, in upper or lower case, or an empty string."""
    folded = {one.lower(): one for one in known}
    match = difflib.get_close_matches(name.lower(), folded, n=1)
    return f" Did you mean `{folded[match[0]]}`?" if match else ""
