"""Child processes that talk in length-checked frames: a JSON header and named binary blobs, never pickle.

This is the only module that starts Python. The sandbox server, the trainer and the embedded language model are modules
that `Worker` runs; on their side they open a `Channel`. Every other Python process is started with `interpreter`.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import math
import os
import select
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from . import codec
from .codec import DecodeError
from .errors import WorkerError, lacking
from .types.bounds import Count

_PREFIX = struct.Struct("<IQ")  # header bytes, blob bytes
MAX_HEADER = 64 << 20
MAX_BLOBS = 4 << 30
MAX_SAID = 1 << 20
"""Bytes of a child's output that are kept while it works, so that a task that prints in each step fills no disk."""
MOST_NICE = 10
"""Most that a session yields: at this nice value it still gets a tenth of a core where others want all."""
LESS_MEMORY = "use fewer worlds= or a smaller sample="
"""What a person can do where a training needs more memory than there is."""


def interpreter() -> list[str]:
    """The beginning of a command line that runs this Python, without the working directory on its path.

    By default Python looks for modules in the working directory first: a `tempfile.py` that lies there would run. The
    option is -P and not -I, which would also drop PYTHONPATH and the user's packages: tasks may be in either.
    """
    return [sys.executable, "-P"]


def environment(env: Mapping[str, str] | None = None) -> dict[str, str]:
    """Environment variables for `interpreter`; None means this process's.

    An empty entry of PYTHONPATH, such as `PYTHONPATH=$PYTHONPATH:x` can leave, would put the working directory back on
    the path, so it is removed. An explicit entry, such as `.`, is kept: its author wants it.
    """
    found = dict(os.environ if env is None else env)
    if "PYTHONPATH" in found:
        found["PYTHONPATH"] = os.pathsep.join(filter(None, found["PYTHONPATH"].split(os.pathsep)))
    return found


class WorkerDied(WorkerError):
    """The child ended or closed its pipe before it sent a whole frame."""


class WorkerTimeout(WorkerError):
    """The child sent nothing before the deadline."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One message: a header that JSON can hold, and bytes by name."""

    header: Mapping[str, Any]
    blobs: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Head:
    header: Mapping[str, Any]
    blobs: Mapping[str, Count]
    """Sizes [bytes] by name, in the order of the blobs."""


def framed(header: Mapping[str, Any], blobs: Mapping[str, bytes] | None = None) -> bytes:
    """A frame as bytes."""
    blobs = blobs or {}
    head = codec.encode(_Head(header, {name: len(blob) for name, blob in blobs.items()})).encode()
    return b"".join((_PREFIX.pack(len(head), sum(map(len, blobs.values()))), head, *blobs.values()))


def unframed(data: bytes) -> Frame:
    """Inverse of `framed`, for the bytes of one whole frame. Raises WorkerDied for anything else."""
    try:
        return _Reader(-1, begun=data).read(0.0)
    except WorkerTimeout:
        raise WorkerDied("The worker process sent a part of a frame.") from None


def _readable(fd: int, timeout: float) -> bool:
    """Whether something arrives within `timeout` [s], at most an hour. `select` fails for descriptors over 1,023."""
    poll = select.poll()
    poll.register(fd, select.POLLIN)
    return bool(poll.poll(math.ceil(min(timeout, 3600.0) * 1000)))


class _Reader:
    """Reads frames from a pipe with a deadline and size caps."""

    def __init__(self, fd: int, max_blobs: int = MAX_BLOBS, begun: bytes = b"") -> None:
        self.fd, self.max_blobs = fd, max_blobs
        self._buffer = bytearray(begun)

    def _take(self, count: int, deadline: float | None) -> bytes:
        while len(self._buffer) < count:
            if deadline is not None:
                left = deadline - time.monotonic()
                if left <= 0:
                    raise WorkerTimeout("The worker process did not answer in time.")
                if self.fd >= 0 and not _readable(self.fd, left):
                    continue
            chunk = self._next()
            if not chunk:
                raise WorkerDied("The worker process ended before it answered.")
            self._buffer += chunk
        taken = bytes(self._buffer[:count])
        del self._buffer[:count]
        return taken

    def _next(self) -> bytes:
        """Bytes that have arrived; none at the end of the stream, or when another thread has closed the pipe."""
        try:
            return os.read(self.fd, 1 << 20)
        except OSError as error:
            if error.errno != errno.EBADF:
                raise
            return b""

    def ready(self, timeout: float) -> bool:
        """Whether something arrived, waiting up to `timeout` [s] for it; the end of the stream counts as something."""
        return bool(self._buffer) or self.fd < 0 or _readable(self.fd, timeout)

    def read(self, timeout: float | None) -> Frame:
        deadline = None if timeout is None else time.monotonic() + timeout
        head_size, blob_size = _PREFIX.unpack(self._take(_PREFIX.size, deadline))
        if head_size > MAX_HEADER or blob_size > self.max_blobs:
            raise WorkerDied(f"The worker process announced an oversized frame ({head_size} + {blob_size} bytes).")
        try:
            head = codec.decode(_Head, self._take(head_size, deadline))
            if sum(head.blobs.values()) != blob_size:
                raise DecodeError("blobs of another size")
        except DecodeError:
            raise WorkerDied("The worker process sent a malformed frame.") from None
        return Frame(head.header, {name: self._take(size, deadline) for name, size in head.blobs.items()})


class Worker:
    """Parent's end: runs `python -m module` in its own process group and exchanges frames with it.

    The child can import the modules that this process can: a task may lie in the folder of a script or a notebook, and
    packages where only PYTHONPATH names them. These folders come last on the child's path.

    Args:
        module: import path whose `__main__` opens a `Channel`.
        env: the child's whole environment; None inherits this process's.
        nice: how much more the child yields to other processes than this process does, 0 to 19. None is for a child
            that somebody waits for: its session gets a full share of the cores, however much this process yields.
        max_blobs: most bytes of blobs in a frame from the child.

    Raises:
        WorkerError: where this machine has no room for a process, or no folder for temporary files.
    """

    def __init__(
        self,
        module: str,
        *,
        args: tuple[str, ...] = (),
        env: Mapping[str, str] | None = None,
        nice: int | None = None,
        max_blobs: int = MAX_BLOBS,
    ) -> None:
        # The package directory is a part of the code, so that the child finds it even with an empty environment. It
        # ends up last on the path: nothing else in that directory may be found before the standard library.
        root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
        last = [root, *map(os.path.abspath, sys.path)]
        code = (
            f"import os, sys, runpy; os.nice({nice or 0}); sys.path.insert(0, {root!r}); import openeureka; "
            f"del sys.path[0]; sys.path += {last!r}; runpy.run_module({module!r}, run_name='__main__')"
        )
        self._start([*interpreter(), "-c", code, *args], env, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        if nice is not None:
            _yield_group(self.process.pid, os.getpriority(os.PRIO_PROCESS, 0) + nice)
        assert self.process.stdin is not None and self.process.stdout is not None
        self._stdin, self._stdout = self.process.stdin, self.process.stdout
        self._reader = _Reader(self._stdout.fileno(), max_blobs)

    def _start(self, command: Sequence[str], env: Mapping[str, str] | None, **pipes: Any) -> None:
        """Raises WorkerError where this machine has no room for a process, and OSError if there is no such program."""
        try:
            with ExitStack() as failing:
                self._stderr: IO[bytes] = failing.enter_context(tempfile.TemporaryFile())
                fcntl.fcntl(self._stderr, fcntl.F_SETFL, fcntl.fcntl(self._stderr, fcntl.F_GETFL) | os.O_APPEND)
                self.process = subprocess.Popen(
                    command, env=environment(env), start_new_session=True, **{"stderr": self._stderr, **pipes}
                )
                failing.pop_all()  # the file must live as long as the process
        except OSError as error:
            if said := lacking(error):
                raise WorkerError(said) from None
            raise

    def send(self, header: Mapping[str, Any], blobs: Mapping[str, bytes] | None = None) -> None:
        """Send one frame. Raises WorkerDied when the child is gone."""
        try:
            self._stdin.write(framed(header, blobs))
            self._stdin.flush()
        except (BrokenPipeError, ValueError):
            raise WorkerDied("The worker process ended before it could be asked.") from None

    def receive(self, timeout: float | None = None) -> Frame:
        """Next frame, within `timeout` [s]. Raises WorkerDied or WorkerTimeout; the worker must then be closed, since
        its stream is broken."""
        frame = self._reader.read(timeout)
        if os.fstat(self._stderr.fileno()).st_size > MAX_SAID:  # the child goes on working: these are no last words
            os.ftruncate(self._stderr.fileno(), 0)
        return frame

    def ready(self, timeout: float) -> bool:
        """Whether `receive` has something to read, waiting up to `timeout` [s] for it."""
        return self._reader.ready(timeout)

    def fileno(self) -> int:
        """Descriptor for waiting on several workers. It does not show what is already buffered: ask `ready` first."""
        return self._reader.fd

    def ending(self) -> str:
        """The signal that ended the child, in a sentence for a person; empty when it was none, or after `close`."""
        # The child's pipe closes before the child is gone: shortly on an idle machine, seconds on a busy one.
        end, found = time.monotonic() + 10.0, None
        while found is None and self.process.returncode is None and time.monotonic() < end:
            # The child is left unreaped: until `close` reaps it, no other group can get its number.
            try:
                found = os.waitid(os.P_PID, self.process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            except ChildProcessError:  # something else reaped it, as where SIGCHLD is ignored
                return ""
            time.sleep(0.0 if found else 0.01)
        if found is None or found.si_code == os.CLD_EXITED:
            return ""
        if found.si_status == signal.SIGKILL:
            return f"It was killed, often by the kernel when memory runs out: {LESS_MEMORY}."
        return f"It was ended by {signal.Signals(found.si_status).name}."

    def stderr_tail(self, size: int = 2000) -> str:
        """Last part of what the child wrote to stderr, for a message to a person."""
        end = self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(0, end - size))
        return self._stderr.read().decode(errors="replace").strip()

    def last_words(self) -> str:
        """The last line that the child wrote to stderr, such as that of a traceback."""
        return (self.stderr_tail().splitlines() or [""])[-1].strip()

    def close(self) -> None:
        """Kill the child's process group, also if the child has ended and left others, and reap it; safe to call
        twice."""
        if self.process.returncode is None:  # once it is reaped, another group may have its number
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self._reader.fd = -1  # another pipe may soon get this number, and another thread may be about to read
        for pipe in (self._stdin, self._stdout, self._stderr):
            with suppress(BrokenPipeError):
                pipe.close()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _yield_group(pid: int, nice: int) -> None:
    """Give a session the nice value of its leader, but leave it a tenth of a core: with less, trainings seem to hang.

    Linux divides the cores among sessions first, and only then by nice value among the processes of each (sched(7),
    autogroup). A worker has a session to itself, and would get as much as the person who uses this machine.
    """
    for _ in range(20 if nice > 0 else 0):
        try:
            Path(f"/proc/{pid}/autogroup").write_text(str(min(nice, MOST_NICE)))
        except BlockingIOError:  # the kernel accepts one such write per tenth of a second
            time.sleep(0.1)
        except OSError:  # this kernel has no autogroups
            return
        else:
            return


class Stranger(Worker):
    """A `Worker` in another Python, which runs a file that knows nothing of this package.

    Its frames have two pipes to themselves, whose descriptors are the file's first arguments: nothing that Python
    prints, before the file begins or after, gets among them.

    Args:
        python: the other interpreter, a path or a name that PATH finds.
        file: the file to run, with neither its own directory nor the working directory on its path.
        shared: a descriptor that the child inherits, whose number is the last argument.

    Raises:
        WorkerDied: when there is no such program.
    """

    def __init__(self, python: str, file: Path, *, shared: int, env: Mapping[str, str] | None = None) -> None:
        code = (
            "import sys; sys.path[:] = [place for place in sys.path if place]; import runpy; "
            f"runpy.run_path({str(file)!r}, run_name='__main__')"
        )
        theirs_in, ours_out = os.pipe()
        ours_in, theirs_out = os.pipe()
        self._stdin, self._stdout = os.fdopen(ours_out, "wb"), os.fdopen(ours_in, "rb")
        numbers = (theirs_in, theirs_out, shared)
        try:
            with tempfile.TemporaryFile() as printed:
                command = [python, "-c", code, *map(str, numbers)]
                self._start(command, env, stdin=subprocess.DEVNULL, stdout=printed, pass_fds=numbers)
        except (OSError, WorkerError) as error:
            self._stdin.close()
            self._stdout.close()
            if isinstance(error, WorkerError):
                raise
            raise WorkerDied(lacking(error) or f"{python} cannot be started: {error.strerror}.") from None
        finally:
            os.close(theirs_in)
            os.close(theirs_out)
        self._reader = _Reader(ours_in)


class Channel:
    """Child's end. Stray prints go to stderr, and the child dies with its parent."""

    def __init__(self) -> None:
        self._out = os.dup(1)
        os.dup2(2, 1)
        self._reader = _Reader(os.dup(0))
        parent = os.getppid()
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
            if os.getppid() != parent:
                os._exit(1)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
        # So is SIGTERM, which a shutdown and Slurm send to every process. A handler and not SIG_IGN: processes started
        # from here would inherit SIG_IGN, and whoever terminates one would wait for ever.
        signal.signal(signal.SIGTERM, lambda *_: None)
        term = {signal.SIGTERM}  # blocked until a forked process has the default action back
        os.register_at_fork(
            before=lambda: signal.pthread_sigmask(signal.SIG_BLOCK, term),
            after_in_parent=lambda: signal.pthread_sigmask(signal.SIG_UNBLOCK, term),
            after_in_child=lambda: (
                signal.signal(signal.SIGTERM, signal.SIG_DFL),
                signal.pthread_sigmask(signal.SIG_UNBLOCK, term),
            ),
        )

    def receive(self, timeout: float | None = None) -> Frame | None:
        """Next frame, or None when the parent closed the pipe."""
        try:
            return self._reader.read(timeout)
        except WorkerDied:
            return None

    def ready(self) -> bool:
        """Whether `receive` has something to read, the end of the pipe included."""
        return self._reader.ready(0.0)

    def send(self, header: Mapping[str, Any], blobs: Mapping[str, bytes] | None = None) -> None:
        data = memoryview(framed(header, blobs))
        while data:
            data = data[os.write(self._out, data) :]
