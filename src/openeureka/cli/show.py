"""`eureka show` and `eureka report`: a run as a table, and as files."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from ..display.live import verdict_line
from ..display.progress import working
from ..numbers import columns, dollars, number, scored
from ..parsing import command_line, parse
from ..refine.hardened import Robust
from ..refine.tuned import Tuned
from ..report import costs, fitted, robust, tables
from ..report.build import build
from ..report.verdict import limits_reason, meaning, none_found, of_polishing, of_tuning, verdict
from ..report.view import RunView
from ..runs import trust
from ..store import artifacts, is_held
from ..store.db import LOG
from ..text import plain
from ..types import CandidateId, Remark, Scored
from .facts import written
from .settings import ReportConfig, only_path, split

MAX_SAID = 4_000
"""Characters shown of what a person said at a time."""


def show(directory: Path, *, as_json: bool = False) -> None:
    """Print every slot of every generation, the final scores and the best reward."""
    run = RunView.read(directory)
    if as_json:
        print(written(run))
        return
    if run.tunes:
        tell([*tuned(run), *(["", *robust_lines(run.robust)] if run.robust is not None else [])])
        return
    if not run.searched:
        tell([*given_lines(run), *_costs(run)])
        tell(robust_lines(run.robust) if run.robust is not None else [])
        return
    strengths = run.ranking.strengths
    slots = [_slot(entry, strengths) for entry in run.history.entries]
    votes = ["votes"] if strengths else []
    titles = ("generation", "slot", "candidate", "try", "F played", "F in training", *votes, "checked")
    tell([columns([titles, *slots]) if slots else "No generation is trained yet.", *_costs(run)])
    said = [_said(f"After generation {g.index}", g.remarks) for g in run.history.generations]
    print("".join([*said, _said("Since the last prompt", run.unheard)]))
    tell(summary(run))
    if len(run.history.generations) < run.config.generations and not is_held(directory):
        log = f"{directory / LOG} shows what it did last. " if artifacts.exists(directory, LOG) else ""
        print(plain(f"This run has stopped. {log}To continue: {command_line('resume', directory)}"))
    if (best := run.best_text) is not None and run.best is not None:
        fitted = " with fitted numbers" if run.fitted is not None else ""
        print(f"\nBest reward, {run.best.place}{fitted}:\n\n{plain(best.source)}")


def tell(lines: Sequence[str]) -> None:
    """Print tables and sentences. On a terminal, sentences are wrapped between words. Rows of a table are not: two
    blanks between cells tell them apart."""
    text = plain("\n".join(lines))
    if sys.stdout is not None and sys.stdout.isatty():
        width = shutil.get_terminal_size().columns
        wrap = partial(textwrap.fill, width=width, break_long_words=False, break_on_hyphens=False)
        text = "\n".join(line if "  " in line else wrap(line) for line in text.splitlines())
    print(text)


def _said(when: str, remarks: Sequence[Remark]) -> str:
    """The remarks of a person under a title, an indented line each."""
    lines = plain(tables.said(remarks)[:MAX_SAID]).splitlines()
    return "".join([f"\n{when}:", *(f"\n  {line}" for line in lines)]) if lines else ""


def _costs(run: RunView) -> list[str]:
    """The costs with a limit, for the policies that were played. No terminal is wide enough for all; the report is."""
    found = costs.table(run, run.config.cost_limits)
    return ["", *(_lines(found) if found.rows else [])]


def _slot(entry: Scored, strengths: Mapping[CandidateId, float]) -> tuple[str, ...]:
    sample = entry.sample
    name = sample.candidate.id if sample.candidate else "-"
    place = (str(sample.generation), str(sample.slot), name, str(sample.attempts))
    votes = [number(strengths.get(name), 3)] if strengths else []
    return (*place, scored(entry.played), number(entry.fitness), *votes, verdict_line(sample))


def summary(run: RunView) -> list[str]:
    """The result in a few lines."""
    how = "played" if run.ranks == "played" else "in training"
    lines = [
        f"Generation {g.index}: best F {how} {number(g.best.score if g.best else None)}, "
        f"{g.trained} of {len(g.entries)} trained"
        for g in run.history.generations
    ]
    lines += [f"{name.capitalize()} reward: F {how} {number(run.baseline_score(name))}" for name in run.baselines]
    if run.outcome is not None:
        lines += ["", *_lines(tables.final(run, run.outcome))]
        if (score := tables.on_scale(run.outcome)) is not None:
            lines.append(f"Human-normalised score, held out: {number(score)}. {tables.SCALE}")
        lines += [verdict(run), meaning(run)]
        lines += [f"Suspected reward hacking: {sign.kind}. {sign.sentence}" for sign in run.signs]
    elif lost := limits_reason(run) or none_found(run):
        lines.append(lost)
    elif len(run.history.generations) < run.config.generations:
        lines.append(f"{len(run.history.generations)} of {run.config.generations} generations are done.")
    if (found := run.tuned) is not None:
        lines += ["", "The best reward with fitted numbers:", "", *_fitted(run, found), ""]
    if (on := run.polished) is not None:
        carried = [*_lines(tables.polished(run, on)), of_polishing(on)]
        lines += ["", "The best policy, trained further:", "", *carried, ""]
    if run.robust is not None:
        lines += ["", *robust_lines(run.robust), ""]
    tokens = run.usage.prompt_tokens + run.usage.completion_tokens
    return [*lines, f"Spent: {tokens:,} tokens, US$ {dollars(run.usage.cost_usd)}"]


def given_lines(run: RunView) -> list[str]:
    """What the trainings of given rewards have found, as aligned text."""
    scores = tables.given(run)
    return [columns([scores.titles, *scores.rows]), "", scores.note, plain(verdict(run))]


def tuned(run: RunView) -> list[str]:
    """What the fitting of a reward's numbers has found, as aligned text."""
    found = run.tuned
    return [*_fitted(run, found), meaning(run)] if found is not None else ["No reward has been trained yet."]


def robust_lines(found: Robust) -> list[str]:
    """What `eureka robust` found, as aligned text."""
    return [
        *_lines(robust.arms(found)),
        *_lines(robust.worlds(found)),
        *_lines(robust.carried(found)),
        robust.verdict(found),
    ]


def _fitted(run: RunView, found: Tuned) -> list[str]:
    shown = [fitted.numbers(found), *([fitted.finals(run, found), fitted.components(found)] if found.finals else [])]
    lines = [line for table in shown if table.rows for line in _lines(table)]
    return [*lines, plain(of_tuning(found))]


def _lines(table: tables.Table) -> list[str]:
    return [*plain(columns([table.titles, *table.rows])).splitlines(), *([table.note] if table.note else []), ""]


def report(words: Sequence[str]) -> None:
    """Write the files of the report again and say where they are."""
    settings, paths = split(words)
    directory = only_path(paths, "eureka report outputs/<time>_cartpole")
    config = parse(ReportConfig, settings)
    stored = RunView.read(directory).config  # refuses a damaged run before anything is announced
    artifacts.expect_writable(directory)
    env = config.env or (stored.env if "env" not in trust.unknown(stored) else "")
    with working("Writing the report and the missing videos"):
        problems = build(directory, config.video, env)
    print(f"Wrote {directory / 'report.html'}")
    for problem in problems:
        print(plain(problem))
