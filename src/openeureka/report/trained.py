"""`report.html` of `eureka train`: given rewards beside each other, in one file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping

from markupsafe import Markup

from ..config import short_name
from ..types import TrainingResult
from . import inert
from .html import intent
from .tables import Table


def report(env: str, scores: Table, settings: Table, results: Mapping[str, TrainingResult]) -> str:
    """The page: a row of scores for each reward, and of each training, by job, its curves."""
    return (
        inert.environment()
        .get_template("trained.html")
        .render(
            style=Markup(inert.text("report.css")),
            title=short_name(env),
            intent=intent(env),
            scores=scores,
            settings=settings,
            results=results,
        )
    )
