"""`report.html`: a whole run in one file that needs no network, for people who were not there.

All text of models, programs and trainings is inert: a template engine escapes every value, terminal and direction
controls are taken out on the way, long texts are cut, and the page forbids scripts and requests altogether.
"""

from __future__ import annotations

import base64
from pathlib import Path

from markupsafe import Markup

from ..config import short_name
from ..errors import TaskError
from ..store import artifacts
from ..tasks import registry
from . import inert
from .view import RunView

MAX_EMBEDDED = 8 << 20
"""Bytes of a video that goes into the page itself; the page is meant to be mailed."""


def report(run: RunView, directory: Path) -> str:
    """The page. The video of the best policy is part of it, those of single candidates are linked."""
    return (
        inert.environment()
        .get_template("report.html")
        .render(
            run=run,
            style=Markup(inert.text("report.css")),
            title=short_name(run.config.env),
            intent=intent(run.config.env),
            best_video=_embedded(directory, run.videos.get("best", "")),
            baseline_videos=[(name, run.videos[r.lane]) for name, r in run.baselines.items() if r.lane in run.videos],
            linked_videos=any(candidate.video for candidate in run.candidates),
        )
    )


def intent(env: str) -> str:
    """The sentence of a task that is installed; a report does not import other people's files."""
    try:
        return registry.get(env).description if registry.installed(env) else ""
    except TaskError:
        return ""


def _embedded(directory: Path, path: str) -> str:
    """The video as a data URL; a large one stays a link."""
    film = artifacts.read(directory, path) if path else None
    if film is None or len(film) > MAX_EMBEDDED:
        return path
    return "data:video/mp4;base64," + base64.b64encode(film).decode()
