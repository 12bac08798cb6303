"""Where trainings under way leave their state, so that what ends a process costs minutes and not hours."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..codec import DecodeError, decode, encode
from ..store import artifacts
from ..version import __version__

ABOUT = ".json"


def groups(folder: Path | None, env: str) -> list[list[str]]:
    """Lane ids of each population of a task that has left a snapshot there. What cannot be read is left out: its
    training begins anew."""
    if folder is None:
        return []
    names = (name for name in artifacts.names(folder.parent, folder.name) if name.endswith(ABOUT))
    found = (_about(artifacts.read(folder.parent, f"{folder.name}/{name}")) for name in names)
    return [about.lanes for about in found if about is not None and about.env == env]


@dataclass(frozen=True, slots=True)
class _About:
    env: str
    lanes: list[str]


def _about(data: bytes | None) -> _About | None:
    try:
        return decode(_About, data or b"")
    except DecodeError:
        return None


class Snapshot:
    """The newest state of one population, in a file that exists while the training is unfinished; beside it, its lanes.

    Args:
        folder: where the file is; None keeps nothing.
        request: what is trained. Another request, or another version of this package, has another file.
    """

    def __init__(self, folder: Path | None, request: Mapping[str, Any]) -> None:
        text = json.dumps([__version__, request], sort_keys=True)
        name = hashlib.sha256(text.encode()).hexdigest()[:16]
        self._folder = folder
        self._name = f"{folder.name}/{name}" if folder is not None else ""
        self._about = {"env": request.get("env"), "lanes": [lane["id"] for lane in request.get("lanes", ())]}
        self._renewed = False

    def read(self) -> bytes | None:
        """The state to begin with; None to begin anew."""
        self._renewed = False
        return artifacts.read(self._folder.parent, f"{self._name}.pt") if self._folder is not None else None

    def write(self, state: bytes) -> None:
        """Raises StoreError when the disk is full; the old file is then still whole."""
        if self._folder is not None:
            artifacts.write(self._folder.parent, f"{self._name}{ABOUT}", encode(self._about))
            artifacts.write(self._folder.parent, f"{self._name}.pt", state)
            self._renewed = True

    def distrust(self) -> None:
        """Forget a state from which a worker came no further than its death."""
        if not self._renewed:
            self.remove()

    def remove(self) -> None:
        """The training is finished; the folder goes with the last file."""
        if self._folder is None:
            return
        for suffix in (".pt", ABOUT):
            artifacts.remove(self._folder.parent, f"{self._name}{suffix}")
        with suppress(OSError):  # others are under way
            self._folder.rmdir()
