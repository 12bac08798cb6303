"""`report.html`, a whole run in one file that needs no network; and the templates that it shares with `eureka ui`.

All text of models, programs and trainings is inert: a template engine escapes every value, terminal and direction
controls are taken out on the way, long texts are cut, and the page forbids requests and every script but its own, which
is known by its hash.
"""

from __future__ import annotations

import base64
import difflib
import hashlib
import json
import math
import re
from dataclasses import replace
from functools import cache
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import Any, Literal, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from pygments.lexers import PythonLexer
from pygments.token import STANDARD_TYPES

from ..codec import to_builtins
from ..config import NO_MODEL, short_name
from ..numbers import dollars, duration, number, scored
from ..store import artifacts
from ..tasks import registry
from ..text import plain
from . import charts, costs, dots, family, fitted, hints, next_steps, robust, tables, verdict
from .candidates import CandidateState, CandidateView
from .view import FOLDERS, RunView

MAX_EMBEDDED = 8 << 20
"""Largest video that goes into the page itself [bytes]; the page is meant to be mailed."""
LIMITS = {"TEXT": 30_000, "CELL": 400, "NAME": 60}
"""Characters shown of a text, of a cell and of a name."""
CONTEXT = 3
"""Unchanged lines shown around a change."""
MAX_CHARACTERS = 40_000
"""Longest program that is compared [characters]: a longer one was refused for its size, and would take minutes."""
MAX_LINES = 500
"""Most lines of a program that is compared: many that are alike would take minutes too."""
STYLE = ("vendor/pico.min.css", "vendor/uPlot.min.css", "page.css")
SCRIPT = ("vendor/uPlot.iife.min.js", "page.js")
"""Files that every page shares, the report too."""
PAGE_SCRIPT = (*SCRIPT, "ui/follow.js", "ui/play.js")
"""The scripts of `eureka ui`."""
Kind = Literal["added", "removed", "kept", "place"]
COLOURED = {
    "k", "kn", "kc", "ow", "nf", "nc", "s1", "s2", "sd", "se", "si", "sa",
    "mi", "mf", "mh", "c1", "ch", "cm", "nb", "bp",
}  # fmt: skip
"""Pygments' names for the tokens that the style sheet has a colour for."""
_KINDS: dict[str, Kind] = {"+": "added", "-": "removed", " ": "kept", "@": "place"}


def report(run: RunView, directory: Path) -> str:
    """The page. Videos of the policies that a run has found are embedded, those of single candidates are linked."""
    found = {name: _embedded(directory, run.videos[name]) for name in FOLDERS if name in run.videos}
    run, where = replace(run, videos={**run.videos, **found}), _here(directory)
    return (
        environment()
        .get_template("report.html")
        .render(
            run=run,
            best=run.best,
            where=where,
            commands=next_commands(run, directory, where),
            title=short_name(run.config.env),
            intent=intent(run.config.env),
            baseline_videos=[(name, run.videos[r.lane]) for name, r in run.baselines.items() if r.lane in run.videos],
            linked_videos=any(candidate.video for candidate in run.candidates),
        )
    )


def notebook(kind: Literal["run", "candidate", "reward"], *shown: object) -> str:
    """What a notebook shows of a noun: a block with its own style, which fetches and runs nothing."""
    macros: Any = environment().get_template("notebook.html").make_module({"best_first": _best_first})
    return str(getattr(macros, f"of_{kind}")(*shown))


def _best_first(run: RunView) -> list[CandidateView]:
    """The candidates by score, the best first; those without a score come last, in order."""
    return sorted(run.candidates, key=lambda c: math.inf if c.score is None else -c.score)


def intent(env: str) -> str:
    """The description of a task that is installed; a report does not import other people's files."""
    task = registry.offered(env)
    return task.description if task is not None else ""


def next_commands(run: RunView, directory: Path, where: str) -> list[tuple[str, str]]:
    """What to type next, with `where` for the run's directory."""
    return next_steps.commands(run, where, kept=artifacts.exists(directory, "best/policy.safetensors"))


def _here(directory: Path) -> str:
    """The run as a person types it in the working directory. A report that is passed on names no folder above that."""
    try:
        return str(directory.resolve().relative_to(Path.cwd()))
    except ValueError:
        return "DIR"


def _embedded(directory: Path, path: str) -> str:
    """The video as a data URL; a large one stays a link."""
    film = artifacts.read(directory, path)
    if film is None or len(film) > MAX_EMBEDDED:
        return path
    return "data:video/mp4;base64," + base64.b64encode(film).decode()


@cache
def environment() -> Environment:
    """The template engine of the folder `templates`, with all that reports show."""
    environment = Environment(
        loader=PackageLoader("openeureka"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_inert,
    )
    shown = (breakable, code, cut, data, dollars, duration, model, number, scored)
    environment.filters |= {function.__name__: function for function in shown}
    environment.globals |= LIMITS | {
        "tables": tables,
        "fitted": fitted,
        "verdict": verdict,
        "charts": charts,
        "costs": costs,
        "dots": dots,
        "family": family,
        "robust": robust,
        "hints": hints.hints,
        "shares": hints.shares,
        "together": together,
        "source_hash": source_hash,
        "STYLE": STYLE,
        "SCRIPT": SCRIPT,
        "PAGE_SCRIPT": PAGE_SCRIPT,
        "STATES": tuple(CandidateState),
        "changes": changes,
    }
    return environment


def text(name: str) -> str:
    """A file of the folder `templates` as it is."""
    return (files("openeureka") / "templates" / name).read_text(encoding="utf-8")


@cache
def together(names: tuple[str, ...]) -> Markup:
    """Files of the folder `templates` as one, to stand in a page without escapes."""
    return Markup("\n".join(map(text, names)))


@cache
def source_hash(names: tuple[str, ...]) -> str:
    """The hash by which a content security policy allows these files."""
    return "sha256-" + base64.b64encode(hashlib.sha256(together(names).encode()).digest()).decode()


def code(source: str) -> Markup:
    """A program in colours: escaped text, with a span around each token that has a colour."""
    words = (
        (STANDARD_TYPES.get(kind, ""), text) for kind, text in PythonLexer(stripnl=False).get_tokens(plain(source))
    )
    pieces = []
    for kind, group in groupby(words, key=lambda word: word[0] if word[0] in COLOURED else ""):
        text = escape("".join(word for _, word in group))
        pieces.append(Markup('<span class="{}">{}</span>').format(kind, text) if kind else text)
    return Markup("").join(pieces)


def data(noun: object) -> str:
    """A noun for a script of the page, as JSON."""
    return json.dumps(to_builtins(noun), separators=(",", ":"))


def _inert(value: object) -> object:
    """Cleans every value on its way into the page; the engine then escapes it. Markup, which templates made, passes."""
    return value if isinstance(value, Markup) else plain(str(value))


def cut(text: str, limit: int) -> str:
    """At most `limit` characters of a text, and how many more there are; a name that is cut ends in three dots."""
    more = len(text) - limit
    if more > 0 and limit <= LIMITS["NAME"]:
        return f"{text[:limit]}…"
    return text if more <= 0 else f"{text[:limit]} […] ({more:,} more characters are in the files of the run)"


def model(setting: str) -> str:
    """The name of a model. A replay is named after its run, without the path; a run without a model has a dash."""
    if setting == NO_MODEL:
        return "-"
    kind, separator, path = setting.partition(":")
    return cut(f"replay:{path.rsplit('/', 1)[-1]}" if kind == "replay" and separator else setting, LIMITS["NAME"])


def breakable(text: str) -> Markup:
    """A name that may wrap after a colon, a slash or an underscore; a copy of it is unchanged."""
    escaped = str(escape(plain(text)))  # re.sub would escape what it puts into a Markup
    return Markup(re.sub("([:/_])", r"\1<wbr>", escaped))


class Line(NamedTuple):
    """One line of a unified diff, with its sign."""

    kind: Kind
    text: str


def changes(candidate: CandidateView) -> tuple[Line, ...]:
    """What a program changed in its parent, as a unified diff; empty without a parent, without a change, or where
    either program is too long."""
    own, parent = candidate.program, candidate.parent.candidate if candidate.parent else None
    if own is None or parent is None or max(len(own.source), len(parent.source)) > MAX_CHARACTERS:
        return ()
    before, after = parent.source.splitlines(), own.source.splitlines()
    if max(len(before), len(after)) > MAX_LINES:
        return ()
    lines = difflib.unified_diff(before, after, n=CONTEXT, lineterm="")
    return tuple(Line(_KINDS[line[0]], line) for line in lines)[2:]  # without the names of files
