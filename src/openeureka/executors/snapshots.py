"""Snapshots of trainings under way, so that a killed process costs minutes and not hours."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..codec import DecodeError, decode, encode
from ..store import artifacts
from ..version import __version__

ABOUT = ".json"


def groups(folder: Path | None, request: Mapping[str, Any]) -> list[list[str]]:
    """Lane ids of each population whose snapshot in `folder` matches the request, whatever its lanes. Snapshots that
    cannot be read are left out: their trainings begin anew."""
    wanted = _About.of(request).rest
    return [about.lanes for about in _left(folder).values() if about.rest == wanted]


def forget(folder: Path | None, env: str, lanes: Collection[str]) -> None:
    """Remove the snapshots that hold no lanes but these: nothing more is tried with them."""
    if folder is None:
        return
    for name, about in _left(folder).items():
        if about.env == env and {*about.lanes} <= {*lanes}:
            _remove(folder, name)


@dataclass(frozen=True, slots=True)
class _About:
    """What a snapshot was taken of."""

    env: str
    lanes: list[str]
    digests: list[str]
    """Digest of what each lane trains with."""
    rest: str
    """Digest of all else that was asked for, and of the version of this package."""

    @classmethod
    def of(cls, request: Mapping[str, Any]) -> _About:
        lanes, starts = request.get("lanes", ()), request.get("starts", {})
        rest = {name: part for name, part in request.items() if name not in ("lanes", "starts")}
        own = [[digest for name, digest in starts.items() if name.split()[0] == lane["id"]] for lane in lanes]
        return cls(
            env=request.get("env", ""),
            lanes=[lane["id"] for lane in lanes],
            digests=[_digest(pair) for pair in zip(lanes, own, strict=True)],
            rest=_digest((__version__, rest)),
        )

    def serves(self, other: _About) -> bool:
        """Whether the lanes of `other` can continue from a snapshot of this."""
        mine, theirs = (set(zip(about.lanes, about.digests, strict=False)) for about in (self, other))
        return self.rest == other.rest and mine >= theirs


def _left(folder: Path | None) -> dict[str, _About]:
    """What each snapshot was taken of, by the name of its file."""
    if folder is None:
        return {}
    files = (file for file in artifacts.names(folder.parent, folder.name) if file.endswith(ABOUT))
    found = {file: _about(artifacts.read(folder.parent, f"{folder.name}/{file}")) for file in files}
    return {file.removesuffix(ABOUT): about for file, about in found.items() if about is not None}


def _about(data: bytes | None) -> _About | None:
    try:
        return decode(_About, data or b"")
    except DecodeError:
        return None


def _digest(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]


class Snapshot:
    """The newest state of one population, in a file that exists while the training is unfinished; a file beside it says
    what it was taken of.

    Args:
        folder: where the file is; None keeps nothing.
        request: what is trained. Its lanes can also continue from a snapshot of the same request with more lanes.
        others: whether some of those further lanes have no result yet. Such a snapshot is then not overwritten, because
            they will continue from it.
    """

    def __init__(self, folder: Path | None, request: Mapping[str, Any], *, others: bool = False) -> None:
        self._folder, self._about, self._others = folder, _About.of(request), others
        self._untried = ""
        """Name of the state that a worker was given, until it has continued from it."""
        self._name = _digest((self._about.rest, self._about.lanes, self._about.digests))

    def read(self) -> bytes | None:
        """The state to begin with; None to begin anew."""
        serving = {name: len(about.lanes) for name, about in _left(self._folder).items() if about.serves(self._about)}
        if self._folder is None or not serving:
            return None
        nearest = min(serving, key=lambda name: serving[name])
        if not self._others:
            self._name = nearest
        self._untried = nearest
        return artifacts.read(self._folder.parent, _file(self._folder, nearest, ".pt"))

    def write(self, state: bytes) -> None:
        """Raises StoreError when the disk is full; the old file is then still whole."""
        if self._folder is not None:
            artifacts.write(self._folder.parent, _file(self._folder, self._name, ABOUT), encode(self._about))
            artifacts.write(self._folder.parent, _file(self._folder, self._name, ".pt"), state)
        self.trust()

    def trust(self) -> None:
        """Note that a worker has continued from the state: whatever ends it now, the state is readable."""
        self._untried = ""

    @property
    def suspect(self) -> bool:
        """Whether a worker was given a state, and has not continued from it so far."""
        return bool(self._untried)

    def distrust(self) -> None:
        """Remove the state that is suspect."""
        if self._folder is not None and self._untried:
            _remove(self._folder, self._untried)
            self.trust()

    def remove(self) -> None:
        """Remove the state of a finished training, and the folder with the last file."""
        if self._folder is not None:
            _remove(self._folder, self._name)


def _remove(folder: Path, name: str) -> None:
    for suffix in (".pt", ABOUT):
        artifacts.remove(folder.parent, _file(folder, name, suffix))
    with suppress(OSError):  # it holds the files of other trainings
        folder.rmdir()


def _file(folder: Path, name: str, suffix: str) -> str:
    return f"{folder.name}/{name}{suffix}"
