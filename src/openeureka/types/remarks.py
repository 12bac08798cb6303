"""What a person says of a search."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


class Place(NamedTuple):
    """A slot of a generation: what people call a candidate by, as in `g0s3`."""

    generation: int
    slot: int

    def __str__(self) -> str:
        return f"g{self.generation}s{self.slot}"


class RemarkKind(StrEnum):
    """What a person can say of a search."""

    WORDS = "words"
    FAVOURITE = "favourite"  # the parent of the next generation
    VETO = "veto"  # never a parent and never the best, for good
    VOTE = "vote"  # of two policies, the one that does the task better
    GO = "go"  # the search need not wait longer


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """One thing that a person said."""

    kind: RemarkKind
    text: str = ""
    """The words."""
    candidate: Place | None = None
    """The favourite, the vetoed one, or the one preferred in a vote."""
    over: Place | None = None
    """The other one of a vote."""
