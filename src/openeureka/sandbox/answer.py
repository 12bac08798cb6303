"""What a confined child answers about a program.

A separate module, because the server runs as `__main__`, where the decoder would not find the names in annotations.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..codec import DecodeError, decode
from ..types import Finding, RewardGraph


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Findings, or a graph; neither if what the child wrote made no sense."""

    findings: tuple[Finding, ...] = ()
    graph: RewardGraph | None = None
    lines: tuple[int | None, ...] = ()
    """The program's line for each node of the graph."""
    returns: int | None = None
    """The line that returns the result."""

    @staticmethod
    def read(data: bytes) -> Answer:
        """The answer that a child wrote; an empty one if it wrote anything else."""
        try:
            return decode(Answer, data)
        except DecodeError:
            return Answer()
