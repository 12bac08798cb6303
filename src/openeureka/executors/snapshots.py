"""Where trainings under way leave their state, so that what ends a process costs minutes and not hours."""

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
    """Lane ids of each population that has left a snapshot there of what is requested, whatever its lanes. What cannot
    be read is left out: its training begins anew."""
    wanted = _About.of(request).rest
    return [about.lanes for about in _left(folder).values() if about.rest == wanted]


def forget(folder: Path | None, env: str, lanes: Collection[str]) -> None:
    """Remove what these lanes left and nobody else shares: nothing more is tried with them."""
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
    """Of what each lane trains with."""
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
        """Whether the lanes of another can go on from it."""
        mine, theirs = (set(zip(about.lanes, about.digests, strict=False)) for about in (self, other))
        return self.rest == other.rest and mine >= theirs


def _left(folder: Path | None) -> dict[str, _About]:
    """What there are snapshots of, by the names of their files."""
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
    """The newest state of one population, in a file that exists while the training is unfinished; beside it, its lanes.

    Args:
        folder: where the file is; None keeps nothing.
        request: what is trained. Its lanes go on from what was asked for alike, also where that was in more company:
            of the others there are results.
        others: some of that company have none yet, and are to go on from it later: it is left as it is.
    """

    def __init__(self, folder: Path | None, request: Mapping[str, Any], *, others: bool = False) -> None:
        self._folder, self._about, self._trusted, self._others = folder, _About.of(request), False, others
        self._begun = ""
        self._name = _digest((self._about.rest, self._about.lanes, self._about.digests))

    def read(self) -> bytes | None:
        """The state to begin with; None to begin anew."""
        self._trusted, self._begun = False, ""
        serving = {name: len(about.lanes) for name, about in _left(self._folder).items() if about.serves(self._about)}
        if self._folder is None or not serving:
            return None
        nearest = min(serving, key=lambda name: serving[name])
        if not self._others:
            self._name = nearest
        self._begun = nearest
        return artifacts.read(self._folder.parent, _file(self._folder, nearest, ".pt"))

    def write(self, state: bytes) -> None:
        """Raises StoreError when the disk is full; the old file is then still whole."""
        if self._folder is not None:
            artifacts.write(self._folder.parent, _file(self._folder, self._name, ABOUT), encode(self._about))
            artifacts.write(self._folder.parent, _file(self._folder, self._name, ".pt"), state)
        self.trust()

    def trust(self) -> None:
        """A worker went on from the state: whatever ends it now, it can be read."""
        self._trusted = True

    @property
    def suspect(self) -> bool:
        """Whether a worker was given a state, and has not gone on from it."""
        return bool(self._begun) and not self._trusted

    def distrust(self) -> None:
        """Remove the state that a worker was given."""
        if self._folder is not None and self._begun:
            _remove(self._folder, self._begun)

    def remove(self) -> None:
        """The training is finished; the folder goes with the last file."""
        if self._folder is not None:
            _remove(self._folder, self._name)


def _remove(folder: Path, name: str) -> None:
    for suffix in (".pt", ABOUT):
        artifacts.remove(folder.parent, _file(folder, name, suffix))
    with suppress(OSError):  # others are under way
        folder.rmdir()


def _file(folder: Path, name: str, suffix: str) -> str:
    return f"{folder.name}/{name}{suffix}"
