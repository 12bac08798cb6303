"""What the pages show: each is a sequence of named parts, so that an open one is sent only what changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..config import FEEDBACKS, VIDEOS, RunConfig
from ..report import html
from ..report.view import CandidateView, PromptView, RunView
from ..store import is_run
from ..tasks import registry
from . import folder, remarks
from .folder import Entry, Standing
from .follow import Parts, Version


def layout(template: str, version: Version, **values: object) -> str:
    """A whole page around its parts."""
    page = html.environment().get_template(f"ui/{template}")
    return page.render(version=version, **values)


def start_form() -> dict[str, object]:
    """What the form that starts a run offers."""
    return {"envs": registry.names(), "feedbacks": FEEDBACKS, "videos": VIDEOS, "defaults": RunConfig()}


def listing(entries: Sequence[Entry]) -> Parts:
    """A line for each run."""
    piece = _pieces()
    return {"titles": piece.titles(bool(entries)), **{f"run/{entry.name}": piece.entry(entry) for entry in entries}}


def overview(directory: Path, run: RunView) -> Parts:
    """A whole run: how it stands, and a card for each candidate."""
    piece = _pieces(run=run)
    entry = folder.entry("", directory)
    parts = {
        "head": piece.head(entry, html.intent(run.config.env)),
        "said": piece.said(*remarks.ear(directory)),
        "log": piece.log(folder.log(directory), entry.standing is not Standing.FINISHED),
        "result": piece.result(),
    }
    for generation in reversed(run.generations):
        parts[f"g{generation.index}"] = piece.generation(generation)
        parts |= {html.anchor(candidate): piece.card(candidate) for candidate in generation.candidates}
    return parts


def side_by_side(names: Sequence[str], directory: Path, run: RunView) -> Parts:
    """Everything about some candidates, `g0s1` and the like; unknown ones are left out."""
    known = {html.anchor(candidate): candidate for candidate in run.candidates}
    shown = [known[name] for name in dict.fromkeys(names) if name in known]
    piece = _pieces(run=run)
    listens = remarks.ear(directory).listens
    return {
        html.anchor(c): piece.whole(c, _prompt(run, c), [other for other in shown if other is not c], listens)
        for c in shown
    }


def unreadable(directory: Path, problem: str) -> Parts:
    """A run that cannot be shown, as one that was started and has no store yet."""
    if not is_run(directory):
        problem = "The run has not begun; what it printed so far says why."
    piece = _pieces()
    return {"problem": piece.problem(problem), "log": piece.log(folder.log(directory), True)}


def _prompt(run: RunView, candidate: CandidateView) -> PromptView | None:
    """The one that the candidate's slot answered: prompts are kept by the first slot that they fill."""
    asked = [prompt for prompt in run.generations[candidate.generation].prompts if prompt.slot <= candidate.slot]
    return max(asked, key=lambda prompt: prompt.slot, default=None)


def _pieces(**values: object) -> Any:
    """The macros of the page, which see the values."""
    return html.environment().get_template("ui/pieces.html").make_module(values)
