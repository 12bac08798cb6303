"""Files of a run that a person wants to open. A reader never sees half of one, whatever happens to the writer.

A run's directory may come from anybody: below it no link is followed, and nothing but a regular file is opened.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from ..errors import StoreError
from ..parsing import short_path
from .db import FILENAME, LOCK, LOG, STOP, explained

MAX_FILE = 1 << 30
"""Largest file that is read [bytes]; a policy has some 10 MB."""

_FOLDER = os.O_RDONLY | os.O_DIRECTORY
_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}\.tmp", re.DOTALL)
"""Name of a file while it is being written."""


def write(directory: Path, name: str, content: str | bytes) -> None:
    """Replace a file of the directory atomically and durably, making its folder when missing.

    Several processes may write the same file, such as two reports: the last one wins. `sweep` deletes the temporary
    file of a writer that was killed.

    Args:
        name: path below the directory, such as `best/reward.py`.

    Raises:
        StoreError: when the disk is full, the folder cannot be written or is a link; the old file is then still whole.
    """
    data = content.encode(errors="replace") if isinstance(content, str) else content
    with explained(directory), _folder_of(directory, name, make=True) as (folder, last):
        temporary = f".{last}.{secrets.token_hex(8)}.tmp"
        descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666, dir_fd=folder)
        try:
            with os.fdopen(descriptor, "wb") as file:
                with suppress(OSError):  # a file system without locks
                    fcntl.flock(descriptor, fcntl.LOCK_SH)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, last, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(FileNotFoundError):
                os.unlink(temporary, dir_fd=folder)
            raise
        os.fsync(folder)  # makes the rename durable


def sweep(directory: Path) -> None:
    """Delete the temporary files of killed writers. A writer at work holds a lock on its file, which stays."""
    for folder, _, files in os.walk(directory):
        for name in filter(_TEMPORARY.fullmatch, files):
            path = str((Path(folder) / name).relative_to(directory))
            with suppress(OSError, StoreError):
                file = opened(directory, path, writable=True)  # NFS needs this for LOCK_EX
                if file is not None:
                    with file:
                        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        remove(directory, path)


def read(directory: Path, name: str) -> bytes | None:
    """The content of a file of the directory; None where there is no regular file, or one larger than `MAX_FILE`.

    Raises:
        StoreError: when it cannot be read.
    """
    with explained(directory):
        file = opened(directory, name)
        if file is None:
            return None
        with file:
            return file.read() if os.fstat(file.fileno()).st_size <= MAX_FILE else None


def exists(directory: Path, name: str) -> bool:
    """Whether there is a regular file of that name."""
    try:
        with _folder_of(directory, name) as (folder, last):
            return stat.S_ISREG(os.stat(last, dir_fd=folder, follow_symlinks=False).st_mode)
    except (StoreError, OSError):
        return False


def opened(directory: Path, name: str, *, writable: bool = False) -> BinaryIO | None:
    """A regular file of the directory, to read; None where there is none, or a link, a pipe or a folder is in its
    place."""
    try:
        with _folder_of(directory, name) as (folder, last):
            # Without O_NONBLOCK, opening a pipe would wait for its writer.
            mode = os.O_RDWR if writable else os.O_RDONLY
            descriptor = os.open(last, mode | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    except (StoreError, FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        if _is_link(error):
            return None
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        return None
    return os.fdopen(descriptor, "rb")


def appended(directory: Path, name: str) -> BinaryIO:
    """A file of the directory, opened for appending; made when missing.

    Raises:
        StoreError: where a pipe or the like has its name.
        OSError: for any other failure, such as a link with its name.
    """
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
    descriptor = os.open(directory / name, flags, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise StoreError(_odd(directory, name))
    return os.fdopen(descriptor, "ab")


def names(directory: Path, name: str) -> list[str]:
    """The names in a folder of the directory, sorted, without files that are being written; none where there is no such
    folder, or a link in its place."""
    try:
        with _folder_of(directory, f"{name}/-") as (folder, _):
            return sorted(found for found in os.listdir(folder) if not _TEMPORARY.fullmatch(found))
    except (StoreError, FileNotFoundError):
        return []


def remove(directory: Path, name: str) -> None:
    """Delete a file of the directory, or the link in its place. Raises StoreError when that fails."""
    with explained(directory), suppress(FileNotFoundError), _folder_of(directory, name) as (folder, last):
        os.unlink(last, dir_fd=folder)


def expect_regular(directory: Path, *names: str) -> None:
    """Check files that libraries open by their path. Raises StoreError where one exists and is not a regular file."""
    for name in names:
        with explained(directory), suppress(FileNotFoundError):
            if not stat.S_ISREG(os.lstat(directory / name).st_mode):
                raise StoreError(_odd(directory, name))


def expect_writable(directory: Path, *names: str) -> None:
    """Refuse a directory that cannot be made or that this user may not write, and files there that this user may not
    write: later, the work would be lost. Raises StoreError."""
    with explained(directory):
        place = _present(directory)
        if not place.is_dir():
            raise StoreError(f"{short_path(place)} is a file, not a folder; name another place.")
        for path in (place, *filter(os.path.exists, (directory / name for name in names))):
            if not os.access(path, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _present(directory: Path) -> Path:
    """The directory, or of those above it the first that exists."""
    return next(path for path in (directory, *directory.absolute().parents) if path.exists())


def expect_room(directory: Path) -> None:
    """Raises StoreError where no run can begin or go on in the directory: it is a file, holds other things, or may not
    be written."""
    with explained(directory):
        place = _present(directory)
    if not place.is_dir():
        raise StoreError(f"{short_path(place)} is a file, but a run is a directory; choose another dir=.")
    if place == directory and not (directory / FILENAME).exists() and is_foreign(directory):
        raise StoreError(f"{short_path(directory)} is not empty and not a run; choose another dir=.")
    expect_writable(directory, FILENAME, LOCK)


def is_foreign(directory: Path) -> bool:
    """Whether the directory holds anything but the files of a run that was killed at its very start."""
    with explained(directory):
        own = {LOCK, LOG, STOP, FILENAME, f"{FILENAME}-wal", f"{FILENAME}-shm"}
        return any(path.name not in own for path in directory.iterdir())


@contextmanager
def _folder_of(directory: Path, name: str, *, make: bool = False) -> Generator[tuple[int, str]]:
    """A descriptor of the folder that a file lies in, and the file's own name there.

    Raises:
        StoreError: for a link, or anything but a folder, on the way; for a name that leads out of the directory.
    """
    *parts, last = PurePosixPath(name).parts or ("",)
    if last in ("", "..") or ".." in parts or name.startswith("/") or "\0" in name:
        raise StoreError(f"`{name:.80}` is not a valid file name in {short_path(directory)}.")
    if make:
        directory.mkdir(parents=True, exist_ok=True)
    folder = os.open(directory, _FOLDER)
    try:
        for part in parts:
            if make:
                with suppress(FileExistsError):
                    os.mkdir(part, dir_fd=folder)
                    os.fsync(folder)  # else a power cut may lose the folder of a file whose row survives
            try:
                inner = os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=folder)
            except OSError as error:
                if isinstance(error, NotADirectoryError) or _is_link(error):
                    raise StoreError(_odd(directory, name)) from None
                raise
            os.close(folder)
            folder = inner
        yield folder, last
    finally:
        os.close(folder)


def _is_link(error: OSError) -> bool:
    return error.errno == errno.ELOOP


def _odd(directory: Path, name: str) -> str:
    return (
        f"{short_path(directory / name)} is a link or not a regular file, so nothing was written; "
        "delete it, or choose another dir=."
    )
