"""Files of a run that a person wants to open. A reader never sees half of one, whatever happens to the writer."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .db import explained


def write(path: Path, content: str | bytes) -> None:
    """Replace the file atomically and durably, making its folder when missing.

    Raises:
        StoreError: when the disk is full or the folder cannot be written; the old file is then still whole.
    """
    data = content.encode() if isinstance(content, str) else content
    with explained(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, 0o644)  # mkstemp makes 0600
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
