"""Reward programs: as text, as data, and what was found in them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

from .bounds import Count, FileName, Finite

CandidateId = FileName

Part = None | bool | int | float | str | Mapping[str, int]
"""JSON, where `{"ref": i}` is the value of node i and `{"n": k}` is k times the number of worlds."""
Arg = Part | tuple[Part, ...]
"""An argument of a node."""


@dataclass(frozen=True, slots=True)
class Node:
    """One tensor operation: an allow-listed ATen overload (`add.Tensor`), or `input` with a variable's name as its only
    argument."""

    op: str
    args: tuple[Arg, ...] = ()
    kwargs: Mapping[str, Arg] = field(default_factory=dict[str, Arg])


PROGRESS = "progress_"
"""Prefix of the names of components that say how far an episode has come."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RewardGraph:
    """A reward program as data: a straight line of tensor operations, valid for any number of worlds."""

    nodes: tuple[Node, ...]
    reward: int
    """Index of the node whose value is the total reward, (N,)."""
    components: tuple[tuple[str, int], ...]
    """Component name and node index, in the program's order; each value is (N,) or () float."""
    version: Literal[1] = 1
    """Version of this form of a graph; in a later one, the same text may mean something else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One generated reward program. Equal programs are one candidate: they share a verdict and a training."""

    id: CandidateId
    source: str

    @staticmethod
    def of(source: str) -> Candidate:
        return Candidate(id=hashlib.sha256(source.encode(errors="surrogatepass")).hexdigest()[:12], source=source)


class VerdictCode(StrEnum):
    """Outcome of checking a program, by the layer that decided."""

    ACCEPTED = "accepted"
    NO_PROGRAM = "no_program"  # the reply held no function
    REFUSED = "refused"  # gate: read as text, never run
    CONTRACT = "contract"  # probe: ran in the confined child and broke a rule
    TIMEOUT = "timeout"
    CRASHED = "crashed"
    SCREENED = "screened"  # it could train, but others were preferred


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One reason for a refusal, addressed to the author of the program."""

    rule: str
    """Short kebab-case name of the broken rule, as listed in `docs/guides/your-own-reward.md`."""
    message: str
    fix: str = ""
    """What to write instead."""
    line: Count | None = None

    def sentence(self) -> str:
        where = f"line {self.line}: " if self.line is not None else ""
        fix = f"; {self.fix}" if self.fix else ""
        return f"{where}{self.message} [{self.rule}]{fix}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What gate and probe found. `graph` is set exactly when the code is ACCEPTED."""

    candidate: CandidateId
    code: VerdictCode
    findings: tuple[Finding, ...] = ()
    graph: RewardGraph | None = None
    seconds: Finite = 0.0

    @property
    def accepted(self) -> bool:
        return self.code is VerdictCode.ACCEPTED
