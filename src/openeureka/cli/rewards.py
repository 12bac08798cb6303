"""Reward files named on a command line: checking them."""

from __future__ import annotations

from collections.abc import Sequence

from ..sandbox.client import Sandbox
from ..tasks.record import record_states
from ..tasks.registry import get
from ..text import one_line, plain
from ..types import Candidate, Verdict, VerdictCode


def judge(env: str, candidates: Sequence[Candidate], *, worlds: int = 0, unsafe: bool) -> list[Verdict]:
    """Verdicts in the order of the candidates, by the same gate and sandbox as in a run with so many worlds."""
    if not candidates:
        return []
    task = get(env)
    with Sandbox(task.spec, record_states(env), worlds=worlds or task.recipe.worlds, unsafe=unsafe) as sandbox:
        return [sandbox.check(candidate) for candidate in candidates]


MEANINGS = {
    VerdictCode.ACCEPTED: "it can train",
    VerdictCode.NO_PROGRAM: "there is no reward function in it",
    VerdictCode.REFUSED: "what it says is not allowed in a reward; it was not run",
    VerdictCode.CONTRACT: "it was run on states of the task, and what it did is not what a reward must do",
    VerdictCode.TIMEOUT: "it was run on states of the task, and took too long",
    VerdictCode.CRASHED: "it was run on states of the task, and ended its process",
}


def explain(verdict: Verdict, source: str = "") -> list[str]:
    """The verdict for a person: a line for each finding, or one that says what the program computes.

    Args:
        source: the program, to show a line that Python cannot read.
    """
    if verdict.graph is None:
        lines = source.splitlines()
        told = []
        for finding in verdict.findings:
            told.append(plain(finding.sentence()))
            if finding.rule == "syntax" and finding.line is not None and finding.line <= len(lines):
                told.append(f"    {one_line(lines[finding.line - 1])}")
        return told
    names = ", ".join(plain(name) for name, _ in verdict.graph.components) or "none"
    return [f"{len(verdict.graph.nodes)} tensor operations; components: {names}; {verdict.seconds * 1000:.0f} ms"]
