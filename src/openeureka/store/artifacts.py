"""Files of a run that a person wants to open. A reader never sees half of one, whatever happens to the writer."""

from __future__ import annotations

import os
from pathlib import Path

from .db import explained


def write(path: Path, content: str | bytes) -> None:
    """Replace the file atomically and durably, making its folder when missing.

    The caller holds the run's lock. The temporary name is always the same, so what a killed writer left is overwritten.

    Raises:
        StoreError: when the disk is full or the folder cannot be written; the old file is then still whole.
    """
    data = content.encode() if isinstance(content, str) else content
    temporary = path.with_name(f".{path.name}.tmp")
    with explained(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
