"""Where trainings under way leave their state, so that what ends a process costs minutes and not hours."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import __version__
from ..store import artifacts

ABOUT = ".json"


def groups(folder: Path | None, env: str) -> list[list[str]]:
    """Ids of the jobs of each population of a task that has left a snapshot there."""
    about = [json.loads(path.read_text()) for path in sorted(folder.glob(f"*{ABOUT}"))] if folder is not None else []
    return [found["jobs"] for found in about if found["env"] == env]


class Snapshot:
    """The newest state of one population, in a file that exists while the training is unfinished; beside it, its jobs.

    Args:
        folder: where the file is; None keeps nothing.
        request: what is trained. Another request, or another version of this package, has another file.
    """

    def __init__(self, folder: Path | None, request: Mapping[str, Any]) -> None:
        text = json.dumps([__version__, request], sort_keys=True)
        name = hashlib.sha256(text.encode()).hexdigest()[:16]
        self._path = folder / f"{name}.pt" if folder is not None else None
        self._about = {"env": request.get("env"), "jobs": [job["id"] for job in request.get("jobs", ())]}
        self._renewed = False

    def read(self) -> bytes | None:
        """The state to begin with; None to begin anew."""
        self._renewed = False
        return self._path.read_bytes() if self._path is not None and self._path.is_file() else None

    def write(self, state: bytes) -> None:
        """Raises StoreError when the disk is full; the old file is then still whole."""
        if self._path is not None:
            artifacts.write(self._path.with_suffix(ABOUT), json.dumps(self._about))
            artifacts.write(self._path, state)
            self._renewed = True

    def distrust(self) -> None:
        """Forget a state from which a worker came no further than its death."""
        if not self._renewed:
            self.remove()

    def remove(self) -> None:
        """The training is finished; the folder goes with the last file."""
        if self._path is not None and self._path.is_file():
            self._path.unlink()
            self._path.with_suffix(ABOUT).unlink(missing_ok=True)
            if not any(self._path.parent.iterdir()):
                self._path.parent.rmdir()
