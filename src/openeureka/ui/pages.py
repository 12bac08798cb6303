"""What the pages show: each page is a sequence of named parts, so that an open one is sent only what changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from ..config import FEEDBACKS, VIDEOS, RunConfig
from ..display.now import Curves, Now, read
from ..method import baselines
from ..numbers import duration
from ..report import filming, html, tables
from ..report.candidates import CandidateView, PromptView
from ..report.view import RunView
from ..score import rank
from ..stats import mean
from ..store import Store, is_held, is_run
from ..tasks import registry
from ..types import Glance, lane_id, of_components
from . import actions, folder
from .folder import Entry, RunState
from .follow import Parts, Version


def layout(template: str, version: Version, **values: object) -> str:
    """A whole page around its parts."""
    page = html.environment().get_template(f"ui/{template}")
    return page.render(version=version, **values)


def lost(problem: str) -> str:
    """A page for an address that leads nowhere."""
    return html.environment().get_template("ui/lost.html").render(problem=problem)


def start_form() -> dict[str, object]:
    """The choices in the form that starts a run, and in the one that filters the list."""
    choices = {"envs": registry.names(), "feedbacks": FEEDBACKS, "videos": VIDEOS, "states": tuple(RunState)}
    return {"defaults": RunConfig(), **choices}


def listing(entries: Sequence[Entry]) -> Parts:
    """A line for each run. Also a board for each task and number of steps with two or more runs that have a held-out
    score, the best run first."""
    piece = _pieces(run=None)
    boards: dict[tuple[str, int], list[Entry]] = {}
    for entry in entries:
        if entry.glance is not None and entry.config is not None and entry.glance.held_out is not None:
            boards.setdefault((entry.config.env, entry.config.steps), []).append(entry)
    for board in boards.values():
        board.sort(key=lambda entry: -rank(entry.glance.held_out if entry.glance else None))
    found = {key: board for key, board in sorted(boards.items()) if len(board) > 1}
    return {"runs": piece.runs(entries), "boards": piece.boards(found)}


def _human(entry: Entry) -> float | None:
    """Held-out F of the human reward: from the run's own trainings, or as it was measured beforehand."""
    config, glance = entry.config, entry.glance
    if config is None or glance is None:
        return None
    known = baselines.measured(config) if config.baselines == "known" else None
    return mean(known.human.held_out) if known is not None else glance.human


def overview(directory: Path, run: RunView) -> Parts:
    """A whole run: how far it has come, all candidates, and a card for each."""
    piece = _pieces(run=run)
    entry = folder.entry("", directory)
    commands = html.next_commands(run, directory, str(directory)) if entry.state is not RunState.RUNNING else ()
    parts = {
        "head": "",
        "verdict": piece.found_so_far(commands),
        "numbers": "",
        "now": "",
        "said": piece.said(*actions.ear(directory)),
        "result": piece.result(),
        "table": piece.overview(),
        "log": piece.log(folder.log(directory), entry.state is not RunState.FINISHED),
    }
    for generation in reversed(run.generations):
        parts[f"g{generation.index}"] = piece.generation(generation)
        parts |= {str(candidate.place): piece.card(candidate) for candidate in generation.candidates}
    return parts


def now(directory: Path, run: RunView, name: str = "") -> Parts:
    """How far a run has come, and what it is doing while it is at work."""
    piece, told = _pieces(run=run), _doing(directory)
    entry, tiles = folder.entry(name, directory), tables.tiles(run)
    if told is not None:
        left = f"about {duration(told.left)} of search left" if told.left is not None else ""
        tiles.append(tables.Tile("running", duration(told.seconds), left))
    return {
        "head": piece.head(entry, html.intent(run.config.env)),
        "numbers": piece.numbers(entry, tiles),
        "now": piece.now(told, _places(run)) if told is not None else "",
    }


def side_by_side(names: Sequence[str], directory: Path, run: RunView) -> Parts:
    """Everything about some candidates, `g0s1` and the like; unknown ones are left out."""
    known = {str(candidate.place): candidate for candidate in run.candidates}
    shown = {name: known[name] for name in names if name in known}
    piece, ear = _pieces(run=run), actions.ear(directory)
    back = "candidates?" + urlencode([("show", name) for name in shown])
    lanes = {name: c.result.lane for name, c in shown.items() if c.result is not None}
    kept = filming.kept(directory, lanes.values()) if _in_depth(run.config.env) else ()
    parts = {"said": piece.said(*ear)}
    parts |= {f"play-{name}": piece.play(shown[name]) for name, lane in lanes.items() if lane in kept}
    if not shown:
        parts["none"] = piece.nothing_chosen()
    row = ["", *known, ""]
    for name, c in shown.items():
        beside = row[row.index(name) - 1], row[row.index(name) + 1]
        children = [other for other in run.candidates if other.parent is not None and other.parent.place == c.place]
        others = [other for other in shown.values() if other is not c]
        parts[f"live-{name}"] = ""
        parts[name] = piece.whole(c, _prompt(run, c), others, ear.listens, children, beside, back)
    return parts


def playable(directory: Path, run: RunView, name: str) -> bytes | None:
    """The policy of a candidate, where it can be shown in 3-D."""
    candidate = next((c for c in run.candidates if str(c.place) == name), None)
    if candidate is None or candidate.result is None or not _in_depth(run.config.env):
        return None
    with Store.view(directory) as store:
        return filming.policies(store, [candidate.result.lane]).get(candidate.result.lane)


def _in_depth(env: str) -> bool:
    """Whether MuJoCo can draw the task, and the task is installed: no file that the run names is imported."""
    task = registry.offered(env)
    return task is not None and not task.steps_itself


def trained(directory: Path, run: RunView) -> Parts:
    """The curves of candidates that are being trained."""
    told = _doing(directory)
    if told is None:
        return {}
    piece, places = _pieces(run=run), _places(run)
    found = {lane: curves for lane, curves in told.curves.items() if lane in places and lane not in run.results}
    return {f"live-{places[lane]}": piece.live(told.at_epochs, curves) for lane, curves in found.items()}


def compared(views: Mapping[str, RunView], glances: Mapping[str, Glance], more: int, unread: int) -> Parts:
    """Several runs: what they found, their curves, and the settings in which they differ.

    Args:
        more: how many runs are left out because there are too many.
        unread: how many are left out because they cannot be read.
    """
    configs = [view.config for view in views.values()]
    settings = {field.name: [str(getattr(config, field.name)) for config in configs] for field in fields(RunConfig)}
    differing = {key: values for key, values in settings.items() if len({*values}) > 1}
    piece = _pieces(run=None)
    return {"runs": piece.compared(views, glances, more, unread), "settings": piece.differing(list(views), differing)}


def unreadable(directory: Path, name: str, problem: str) -> Parts:
    """A run that cannot be shown, such as one that was started but has no store yet, or works on another machine."""
    if not is_run(directory):
        problem = "The run has not started; its output below says why."
    piece, state = _pieces(run=None), folder.entry(name, directory).state
    head = {"head": piece.title(name, state)} if name else {}
    return {**head, "problem": piece.problem(problem), "now": "", "log": piece.log(folder.log(directory), True)}


def from_afar(directory: Path) -> Parts:
    """What a run is doing, where its rows cannot be opened, as when it is at work on another machine."""
    told = _doing(directory)
    return {"now": _pieces(run=None).now(told, {})} if told is not None else {}


def vanished() -> Parts:
    """The only part of an open page whose run has been deleted."""
    return {"problem": _pieces(run=None).problem("This run no longer exists.")}


def _doing(directory: Path) -> Now | None:
    """What a run is doing; None where no process works on it, as one that was killed leaves its file behind."""
    return read(directory) if is_held(directory) else None


def _places(run: RunView) -> dict[str, str]:
    """What people call the lanes of candidates and of baselines, by lane id."""
    others = {name: f"{lane.reward} reward" for name, lane in run.lanes.items() if lane.role == "baseline"}
    return others | {lane_id(program, run.config.seed): str(place) for program, place in run.places.items()}


def _prompt(run: RunView, candidate: CandidateView) -> PromptView | None:
    """The prompt of the candidate's slot: prompts are stored by the first slot that they fill."""
    asked = [prompt for prompt in run.generations[candidate.generation].prompts if prompt.slot <= candidate.slot]
    return max(asked, key=lambda prompt: prompt.slot, default=None)


def _pieces(run: RunView | None) -> Any:
    """The macros of the page, with the run among their variables."""
    values = {"run": run, "best": run.best if run is not None else None}
    helpers = {"called": _called, "parts_of": of_components, "human_of": _human}
    return html.environment().get_template("ui/pieces.html").make_module(values | helpers)


def _called(curves: Mapping[str, Curves], places: Mapping[str, str]) -> dict[str, tuple[float | None, ...]]:
    """F of each lane, by the name that people know it by."""
    return {places.get(lane, lane): own.get("fitness", ()) for lane, own in curves.items()}
