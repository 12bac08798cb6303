"""What a program changed of its parent."""

from __future__ import annotations

import difflib
from typing import Literal, NamedTuple

from .view import CandidateView

CONTEXT = 3
"""Unchanged lines shown around a change."""
MAX_CHARACTERS = 40_000
"""A longer program was refused for its size; comparing it would take minutes."""

Kind = Literal["added", "removed", "kept", "place"]
_KINDS: dict[str, Kind] = {"+": "added", "-": "removed", " ": "kept", "@": "place"}


class Line(NamedTuple):
    """One line of a unified diff, with its sign."""

    kind: Kind
    text: str


def to_parent(candidate: CandidateView) -> tuple[Line, ...]:
    """The lines of a unified diff; empty without a parent, without a change, or where either program is too long."""
    own, parent = candidate.candidate, candidate.parent.candidate if candidate.parent else None
    if own is None or parent is None or max(len(own.source), len(parent.source)) > MAX_CHARACTERS:
        return ()
    lines = difflib.unified_diff(parent.source.splitlines(), own.source.splitlines(), n=CONTEXT, lineterm="")
    return tuple(Line(_KINDS[line[0]], line) for line in lines)[2:]  # without the names of files
