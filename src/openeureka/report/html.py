"""`report.html`: a whole run in one file that needs no network, for people who were not there.

All text of models, programs and trainings is inert: a template engine escapes every value, terminal and direction
controls are taken out on the way, long texts are cut, and the page forbids scripts and requests altogether.
"""

from __future__ import annotations

import base64
from functools import cache
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from ..config import short_name
from ..errors import TaskError
from ..tasks import registry
from ..types import Sample
from . import charts, diff, tables
from .text import duration, number, plain
from .view import CandidateView, RunView

MAX_EMBEDDED = 8 << 20
"""Bytes of a video that goes into the page itself; the page is meant to be mailed."""
LIMITS = {"TEXT": 30_000, "CELL": 400, "NAME": 60}
"""Characters shown of a text, of a cell and of a name."""


def report(run: RunView, directory: Path) -> str:
    """The page. The video of the best policy is part of it, those of single candidates are linked."""
    return _template().render(
        run=run,
        title=short_name(run.config.env),
        intent=_intent(run.config.env),
        best_video=_embedded(directory, run.videos.get("best", "")),
        baseline_videos=[(name, run.videos[r.job]) for name, r in run.baselines.items() if r.job in run.videos],
        linked_videos=any(candidate.video for candidate in run.candidates),
    )


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("openeureka"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_inert,
    )
    environment.filters |= {"cut": cut, "number": number, "duration": duration}
    environment.globals |= {"tables": tables, "charts": charts, "diff": diff, "anchor": _anchor, "name": tables.name}
    environment.globals |= LIMITS | {key: getattr(charts, key) for key in ("WIDTH", "HEIGHT", "LEFT", "RIGHT")}
    environment.globals["style"] = Markup(
        (files("openeureka") / "templates" / "report.css").read_text(encoding="utf-8")
    )
    return environment.get_template("report.html")


def _inert(value: object) -> object:
    """Every value on its way into the page; the engine escapes it after this. Markup is what the template made."""
    return value if isinstance(value, Markup) else plain(str(value))


def cut(text: str, limit: int) -> str:
    """At most `limit` characters of a text, and how many more there are."""
    more = len(text) - limit
    return text if more <= 0 else f"{text[:limit]} […] ({more:,} more characters are in the files of the run)"


def _anchor(place: CandidateView | Sample) -> str:
    return str(place.place)


def _intent(env: str) -> str:
    """The sentence of a task that comes with openeureka; a report does not import other people's files."""
    try:
        return registry.get(env).description if ":" not in env else ""
    except TaskError:
        return ""


def _embedded(directory: Path, path: str) -> str:
    """The video as a data URL; a large one stays a link."""
    if not path or (directory / path).stat().st_size > MAX_EMBEDDED:
        return path
    return "data:video/mp4;base64," + base64.b64encode((directory / path).read_bytes()).decode()
