"""`report.md`: what a search did and found, for a person; the page `report.html` says the same with pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..config import short_name
from ..text import one_line, plain
from ..types import Message, Remark, Verdict
from . import diff, tables, verdict
from .tables import Table
from .text import number
from .view import AttemptView, CandidateView, GenerationView, RunView

MAX_TEXT = 30_000
"""Characters shown of one program, prompt or reply."""


def report(run: RunView) -> str:
    """The whole file."""
    sections = (
        f"# {short_name(run.config.env)}: search for a reward",
        f"**{_cell(verdict.verdict(run))}**",
        _cell(f"{verdict.meaning(run)} {verdict.why(run)}"),
        _final(run),
        "![Summary](summary.png)",
        _hacking(run),
        "## The search",
        _table(tables.search(run)),
        "## Generations",
        _table(tables.generations(run)),
        _best(run.best),
        f"## Spent\n\n{tables.spent(run)}",
        *(section for generation in run.generations for section in _generation(generation)),
        *_remarks("What a person said since then:", run.unheard),
        "## Settings",
        _table(tables.settings(run.config)),
    )
    return "\n\n".join(section for section in sections if section) + "\n"


def _final(run: RunView) -> str:
    if run.outcome is None:
        return "## Final scores\n\nThe final trainings are not done yet."
    return (
        f"## Final scores\n\n{_table(tables.final(run.outcome, run.known))}\n\n{_table(tables.measures(run.outcome))}"
    )


def _hacking(run: RunView) -> str:
    if not run.tried:
        return ""
    return f"## Reward hacking\n\n{_table(tables.exploits(run))}\n\n{_table(tables.worlds(run))}"


def _best(best: CandidateView | None) -> str:
    if best is None or best.candidate is None:
        return "## Best reward\n\nNo reward has been trained yet."
    place = f"Generation {best.generation}, slot {best.slot}, candidate {best.candidate.id}."
    return f"## Best reward\n\n{place}\n\n{_code(best.candidate.source)}"


def _generation(generation: GenerationView) -> Iterable[str]:
    yield f"## Generation {generation.index}" + ("" if generation.finished else ", under way")
    for prompt in generation.prompts:
        yield f"What the model was asked for the slots from {prompt.slot} on:"
        yield from _messages(prompt.messages)
    for candidate in generation.candidates:
        yield from _candidate(candidate)
    yield from _remarks("What a person said of it, before the next generation was asked for:", generation.remarks)


def _remarks(title: str, remarks: Sequence[Remark]) -> Iterable[str]:
    if remarks:
        yield title
        yield _code(tables.said(remarks), "")


def _candidate(candidate: CandidateView) -> Iterable[str]:
    place = tables.name(candidate.generation, candidate.slot).capitalize()
    yield f"### {place}: {candidate.state}, F {number(candidate.score)}"
    yield _table(tables.facts(candidate))
    yield _findings(candidate.verdict)
    if candidate.video:
        yield f"[Its policy at work]({candidate.video})"
    if change := diff.to_parent(candidate):
        yield "What it changed of its parent:"
        yield _code("\n".join(line.text for line in change), "diff")
    if candidate.candidate is not None:
        yield "Reward code:"
        yield _code(candidate.candidate.source)
    components = tables.components(candidate)
    yield _table(components) if components.rows else ""
    if candidate.feedback:
        yield "What the model is told about it when it is improved:"
        yield _code(candidate.feedback, "")
    for number_, attempt in enumerate(candidate.attempts, start=1):
        yield from _attempt(f"Reply {number_} of {len(candidate.attempts)}", attempt)


def _attempt(title: str, attempt: AttemptView) -> Iterable[str]:
    yield f"#### {title}: {attempt.verdict.code if attempt.verdict else 'not judged yet'}"
    yield _findings(attempt.verdict)
    if attempt.repair:
        yield "After the prompt of the generation it was also shown:"
        yield from _messages(attempt.repair)
        yield "Its answer:"
    yield _code(attempt.reply.text, "")


def _messages(messages: Iterable[Message]) -> Iterable[str]:
    for message in messages:
        yield f"{_cell(message.role)}:"
        yield _code(message.content, "")


def _findings(verdict: Verdict | None) -> str:
    return "\n".join(f"- {_cell(finding.sentence())}" for finding in verdict.findings) if verdict else ""


def _table(table: Table) -> str:
    lines = [table.titles, ["---"] * len(table.titles), *([_cell(cell) for cell in row] for row in table.rows)]
    note = f"{table.note}\n\n" if table.note else ""
    return note + "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """One line that cannot end a table cell or open a link or a tag: findings quote what models wrote."""
    safe = one_line(text, width=300)
    for sign in "\\|<[`":
        safe = safe.replace(sign, f"\\{sign}")
    return safe


def _code(text: str, language: str = "python") -> str:
    """A fenced block, its fence longer than any in the text."""
    more = len(text) - MAX_TEXT
    shown = plain(text[:MAX_TEXT]).rstrip() + (f"\n[...] {more} more characters" if more > 0 else "")
    fence = "```"
    while fence in shown:
        fence += "`"
    return f"{fence}{language}\n{shown}\n{fence}"
