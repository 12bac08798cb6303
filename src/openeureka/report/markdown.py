"""`report.md`: what a search did and found, for a person."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..config import RunConfig, as_dict
from ..types import Evaluation, History, Scored, TrainingResult, Usage
from .stats import by_generation, human_normalised
from .text import number, one_line, plain


def report(
    config: RunConfig,
    history: History,
    baselines: Mapping[str, TrainingResult],
    evaluations: Mapping[str, Evaluation],
    usage: Usage,
) -> str:
    """The whole file.

    Args:
        baselines: results of the `human` and `sparse` rewards, as far as they were trained.
        evaluations: held-out scores by job.
    """
    sections = (
        _headline(config, history, baselines),
        "![Summary](summary.png)",
        _generations(history),
        _best(history.best),
        _held_out(evaluations),
        _failures(history),
        _spent(usage),
        _settings(config),
    )
    return "\n\n".join(section for section in sections if section) + "\n"


def _headline(config: RunConfig, history: History, baselines: Mapping[str, TrainingResult]) -> str:
    best = history.best
    human, sparse = (baselines[name].fitness if name in baselines else None for name in ("human", "sparse"))
    rows = [
        ("best generated reward", number(best.fitness if best else None)),
        ("human reward", number(human)),
        ("sparse reward", number(sparse)),
        ("human-normalised score of the best", number(human_normalised(best.fitness if best else None, human, sparse))),
    ]
    if best and best.result:
        rows.append(("correlation of the best with the human reward", number(best.result.correlation, 2)))
    return f"# {config.env}: search for a reward\n\n" + _table(("", "F"), rows)


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
    return "## Generations\n\n" + _table(titles, rows)


def _best(best: Scored | None) -> str:
    if best is None or best.sample.candidate is None:
        return "## Best reward\n\nNo reward has been trained yet."
    place = f"Generation {best.sample.generation}, slot {best.sample.slot}, candidate {best.sample.candidate.id}."
    return f"## Best reward\n\n{place}\n\n{_code(best.sample.candidate.source)}"


def _held_out(evaluations: Mapping[str, Evaluation]) -> str:
    if not evaluations:
        return ""
    rows = [
        (job, number(score.fitness), number(score.episode_length), str(score.episodes))
        for job, score in evaluations.items()
    ]
    note = "Deterministic actions, fresh episodes; each policy is the one at the peak of F in its training."
    return f"## Held-out scores\n\n{note}\n\n" + _table(("policy", "F", "episode length", "episodes"), rows)


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
    fence = "```"
    while fence in text:
        fence += "`"
    return f"{fence}{language}\n{plain(text).rstrip()}\n{fence}"
