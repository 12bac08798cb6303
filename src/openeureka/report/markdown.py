"""`report.md`: what a search did and found, for a person."""

from __future__ import annotations

from collections.abc import Sequence

from ..config import RunConfig, as_dict, short_name
from ..score import Baselines, Outcome
from ..types import History, Scored, Usage
from .run import Run
from .stats import by_generation, trained_share
from .text import number, one_line, plain, spread


def report(run: Run) -> str:
    """The whole file."""
    sections = (
        f"# {short_name(run.config.env)}: search for a reward",
        _verdict(run),
        "![Summary](summary.png)",
        _final(run.outcome, run.known),
        _generations(run.history),
        _best(run.history.best),
        _failures(run.history),
        _spent(run.usage),
        _settings(run.config),
    )
    return "\n\n".join(section for section in sections if section) + "\n"


def _verdict(run: Run) -> str:
    best = run.history.best
    rows = [("best generated reward", number(best.fitness if best else None))]
    rows += [(f"{name} reward", number(result.fitness)) for name, result in run.baselines.items()]
    note = "F is the task's own score, its maximum over training. The best of many flatters: see the final scores."
    return f"{note}\n\n{_table(('search', 'F'), rows)}"


def _final(outcome: Outcome | None, known: Baselines | None) -> str:
    if outcome is None:
        return "## Final scores\n\nThe final trainings are not done yet."
    arms = {"best generated reward": outcome.method, "human reward": outcome.human, "sparse reward": outcome.sparse}
    seeds = len(outcome.method.training)
    note = f"Mean ± standard deviation, fresh seeds: {seeds}. Held out: deterministic actions, fresh episodes."
    if known is not None:
        note += f" {known.sentence()}"
    rows = [(name, spread(arm.training), spread(arm.held_out)) for name, arm in arms.items()]
    scores = [
        ("human-normalised score, (F - sparse) / abs(human - sparse), held out", number(outcome.normalised)),
        ("the same on maxima over training, as published", number(outcome.normalised_training)),
        ("correlation with the human reward over transitions", number(outcome.correlation, 2)),
        ("the same over epochs, as the published code computes it", number(outcome.curve_correlation, 2)),
    ]
    titles = ("", "F, maximum over training", "F, held out")
    return f"## Final scores\n\n{note}\n\n{_table(titles, rows)}\n\n{_table(('score', 'value'), scores)}"


def _generations(history: History) -> str:
    rows = [
        (
            str(g.index),
            str(g.slots),
            ", ".join(f"{count} {code}" for code, count in g.verdicts.items()),
            str(g.replies),
            str(g.trained),
            number(g.best),
            number(g.mean),
        )
        for g in by_generation(history)
    ]
    titles = ("generation", "slots", "verdicts", "replies", "trained", "best F", "mean F")
    share = trained_share(history)
    total = f"\n\nOf all slots, {share:.0%} trained." if share is not None else ""
    return "## Generations\n\n" + _table(titles, rows) + total


def _best(best: Scored | None) -> str:
    if best is None or best.sample.candidate is None:
        return "## Best reward\n\nNo reward has been trained yet."
    place = f"Generation {best.sample.generation}, slot {best.sample.slot}, candidate {best.sample.candidate.id}."
    return f"## Best reward\n\n{place}\n\n{_code(best.sample.candidate.source)}"


def _failures(history: History) -> str:
    lines = [
        f"- generation {entry.sample.generation}, slot {entry.sample.slot}: {entry.sample.verdict.code}: "
        + _cell("; ".join(finding.sentence() for finding in entry.sample.verdict.findings))
        for generation in history.generations
        for entry in generation.entries
        if not entry.sample.verdict.accepted
    ]
    return "## Refused programs\n\n" + "\n".join(lines) if lines else ""


def _spent(usage: Usage) -> str:
    tokens = f"{usage.prompt_tokens} prompt tokens and {usage.completion_tokens} completion tokens"
    return f"## Spent\n\n{tokens}, US$ {usage.cost_usd:.4f}."


def _settings(config: RunConfig) -> str:
    return "## Settings\n\n" + _code("\n".join(f"{key}={value}" for key, value in as_dict(config).items()), "")


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [titles, ["---"] * len(titles), *([_cell(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """One line that cannot end a table cell or open a link or a tag: findings quote what models wrote."""
    safe = one_line(text, width=300)
    for sign in "\\|<[`":
        safe = safe.replace(sign, f"\\{sign}")
    return safe


def _code(text: str, language: str = "python") -> str:
    """A fenced block, its fence longer than any in the text."""
    shown = plain(text).rstrip()
    fence = "```"
    while fence in shown:
        fence += "`"
    return f"{fence}{language}\n{shown}\n{fence}"
