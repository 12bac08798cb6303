"""Reward files named on a command line: checking them."""

from __future__ import annotations

from collections.abc import Sequence

from ..report.text import plain
from ..sandbox.client import Sandbox
from ..tasks.record import record_states
from ..tasks.registry import get
from ..types import Candidate, Verdict


def judge(env: str, candidates: Sequence[Candidate], *, worlds: int = 0, unsafe: bool) -> list[Verdict]:
    """Verdicts in the order of the candidates, by the same gate and sandbox as in a run with so many worlds."""
    if not candidates:
        return []
    task = get(env)
    with Sandbox(task.spec, record_states(env), worlds=worlds or task.recipe.worlds, unsafe=unsafe) as sandbox:
        return [sandbox.check(candidate) for candidate in candidates]


def explain(verdict: Verdict) -> list[str]:
    """The verdict for a person: a line for each finding, or one that says what the program computes."""
    if verdict.graph is None:
        return [plain(finding.sentence()) for finding in verdict.findings]
    names = ", ".join(plain(name) for name, _ in verdict.graph.components) or "none"
    return [f"{len(verdict.graph.nodes)} tensor operations; components: {names}; {verdict.seconds * 1000:.0f} ms"]
