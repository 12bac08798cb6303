"""`eureka show` and `eureka report`: a run as a table, and as files."""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..display.live import verdict_line
from ..display.progress import working
from ..numbers import columns, dollars, number, scored
from ..parsing import command_line, parse, short_path
from ..refine.hardened import Robust
from ..refine.polishing import Polished
from ..refine.tuned import Tuned
from ..report import costs, fitted, robust, tables
from ..report.build import build
from ..report.candidates import CandidateView, GenerationView
from ..report.verdict import deciding, limits_reason, meaning, none_found, of_polishing, of_tuning, verdict
from ..report.view import RunView
from ..runs import trust
from ..runs.run import lanes
from ..score import Outcome, SeedScores
from ..store import artifacts, is_held, read_config
from ..store.db import LOG
from ..text import plain
from ..types import CandidateId, Evaluation, Remark, Scored, TrainingResult
from .settings import ReportConfig, only_path, split

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

MAX_SAID = 4_000
"""Characters shown of what a person said at a time."""


def show(directory: Path, *, as_json: bool = False) -> None:
    """Print every slot of every generation, the final scores and the best reward."""
    run = RunView.read(directory)
    if as_json:
        print(json.dumps(facts(run), indent=2))
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
        text = "\n".join(line if "  " in line else _wrapped(line, width) for line in text.splitlines())
    print(text)


def _wrapped(line: str, width: int) -> str:
    return textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False)


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
    lines += ["", "The best reward with fitted numbers:", "", *_fitted(run, found), ""] if (found := run.tuned) else []
    lines += ["", "The best policy, trained further:", "", *_carried_on(run, on), ""] if (on := run.polished) else []
    lines += ["", *robust_lines(run.robust), ""] if run.robust is not None else []
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


def closing(run: RunView, directory: Path) -> list[str]:
    """The last lines of a command that made a run: where everything is, and the command to decide what is open."""
    shown = short_path(directory)
    return [
        f"\nEverything is in {shown}; begin with report.html",
        *(f"To decide what is open: {plain(command)}" for command, _ in deciding(run, str(shown))),
    ]


def _fitted(run: RunView, found: Tuned) -> list[str]:
    shown = [fitted.numbers(found), *([fitted.finals(run, found), fitted.components(found)] if found.finals else [])]
    lines = [line for table in shown if table.rows for line in _lines(table)]
    return [*lines, plain(of_tuning(found))]


def _carried_on(run: RunView, found: Polished) -> list[str]:
    return [*_lines(tables.polished(run, found)), of_polishing(found)]


def _lines(table: tables.Table) -> list[str]:
    return [*plain(columns([table.titles, *table.rows])).splitlines(), *([table.note] if table.note else []), ""]


def facts(run: RunView) -> dict[str, object]:
    """The run for programs. `fitness` is F in training, its maximum over epochs. Undefined values are null."""
    best, text, outcome = run.best, run.best_text, run.outcome
    return {
        "settings": dataclasses.asdict(run.config),
        "ranked_by": run.ranks,
        "generations": [_generation(generation) for generation in run.generations],
        "unheard": [_remark(remark) for remark in run.unheard],
        "baselines": {name: _scores(run.played.get(r.lane), r) for name, r in run.baselines.items()},
        "given": {
            name: {key: value for key, value in lane.row().items() if key not in ("lane", "role", "place")}
            for name, lane in lanes(run).items()
            if lane.lane.role == "given"
        },
        "tuned": _tuned(run.tuned) if run.tuned is not None else None,
        "polished": _polished(run.polished) if run.polished is not None else None,
        "robust": _robust(run.robust) if run.robust is not None else None,
        "best": {"name": str(best.place), "source": text.source} if best and text else None,
        "final": _final(outcome) if outcome is not None else None,
        "verdict": verdict(run),
        "score": outcome.normalised if outcome is not None else None,
        "suspected": [{"kind": sign.kind, "sentence": sign.sentence} for sign in run.signs],
        "usage": dataclasses.asdict(run.usage),
    }


def _fields(noun: DataclassInstance | None) -> dict[str, object] | None:
    return dataclasses.asdict(noun) if noun is not None else None


def _robust(found: Robust) -> dict[str, object]:
    arms = {
        arm.name: {
            "ranges": arm.ranges.drawn if arm.ranges is not None else {},
            "chosen_by": arm.chosen_by,
            "own_world": _fields(arm.nominal),
            "hard": arm.hard,
            "worlds": {name: _fields(score) for name, score in arm.worlds.items()},
        }
        for arm in found.arms
    }
    return {"ours": found.ours, "arms": arms, "verdict": robust.verdict(found)}


def _polished(found: Polished) -> dict[str, object]:
    return {
        "began": found.began._asdict(),
        "before": _fields(found.before),
        "after": _fields(found.after),
        "gain": _fields(found.gain),
        "best": found.best._asdict() if found.best is not None else None,
        "better": found.better,
        "lanes": [
            {
                "lane": one.lane.id,
                "reward": one.lane.reward,
                "fresh": one.start.fresh,
                **_scores(one.played, one.result),
            }
            for one in found.tries
        ],
    }


def _tuned(found: Tuned) -> dict[str, object]:
    return {
        "numbers": [
            {
                "name": effect.weight.name,
                "before": effect.weight.value,
                "after": effect.after,
                "trend": _fields(effect.trend),
                "distance": _fields(effect.distance),
                "matters": effect.matters,
            }
            for effect in found.effects
        ],
        "after": found.after,
        "better": found.better,
        "final": {name: _fields(own) for name, own in found.finals.items()},
        "difference": _fields(found.difference),
        "components": {
            name: dict(zip(("before", "after"), pair, strict=True)) for name, pair in found.components.items()
        },
        "trials": [
            {"name": t.name, "candidate": t.candidate.id, "numbers": list(t.values), "played_fitness": t.played}
            for t in found.trials
        ],
    }


def _generation(generation: GenerationView) -> dict[str, object]:
    return {
        "index": generation.index,
        "finished": generation.finished,
        "slots": [_slot_facts(candidate) for candidate in generation.candidates],
        "remarks": [_remark(remark) for remark in generation.remarks],
    }


def _remark(remark: Remark) -> dict[str, str | None]:
    places = {"candidate": remark.place, "over": remark.over}
    named = {name: str(place) if place is not None else None for name, place in places.items()}
    return {"kind": remark.kind, "text": remark.text, **named}


def _slot_facts(slot: CandidateView) -> dict[str, object]:
    return {
        "name": str(slot.place),
        "candidate": slot.program.id if slot.program is not None else None,
        "state": slot.state,
        "verdict": slot.verdict.code if slot.verdict is not None else None,
        "findings": [dataclasses.asdict(finding) for finding in slot.verdict.findings] if slot.verdict else [],
        "attempts": len(slot.attempts),
        **_scores(slot.played, slot.result),
        "votes": slot.strength,
        "vetoed": slot.vetoed,
    }


def _scores(played: Evaluation | None, result: TrainingResult | None) -> dict[str, object]:
    return {
        "played_fitness": played.fitness if played is not None else None,
        "played_error": played.error if played is not None else None,
        "costs": dict(played.costs) if played is not None else {},
        "fitness": result.fitness if result is not None else None,
    }


def _final(outcome: Outcome) -> dict[str, object]:
    """Every reward of the race with a number for each seed, and how much better the best is than the human one."""
    rewards = {"best": outcome.method, **{str(place): own for place, own in outcome.rivals.items()}}
    rewards |= {"human": outcome.human, "sparse": outcome.sparse}
    found = outcome.difference
    return {
        "rewards": {name: _of_seeds(own) for name, own in rewards.items()},
        "difference": _fields(found),
    }


def _of_seeds(own: SeedScores) -> dict[str, object]:
    return {"fitness": own.training, "held_out_fitness": own.held_out}


def report(words: Sequence[str]) -> None:
    """Write the files of the report again and say where they are."""
    settings, paths = split(words)
    directory = only_path(paths, "eureka report outputs/<time>_cartpole")
    config = parse(ReportConfig, settings)
    stored = read_config(directory)
    env = config.env or (stored.env if "env" not in trust.unknown(stored) else "")
    with working("Writing the report and the missing videos"):
        problems = build(directory, config.video, env)
    print(f"Wrote {directory / 'report.html'}")
    for problem in problems:
        print(plain(problem))
