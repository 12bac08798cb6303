"""What confined children and their parent tell each other of a program.

A module of its own: the server runs as `__main__`, whose names a decoder would look for in vain.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..codec import DecodeError, decode
from ..types import Finding, RewardGraph


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Findings, or a graph. Neither, where it made no sense."""

    findings: tuple[Finding, ...] = ()
    graph: RewardGraph | None = None
    lines: tuple[int | None, ...] = ()
    """Of the program, for each node."""
    returns: int | None = None
    """The line that returns the result."""

    @staticmethod
    def read(data: bytes) -> Answer:
        """What a child wrote, whatever that is: an empty answer for anything else than one."""
        try:
            return decode(Answer, data)
        except DecodeError:
            return Answer()
