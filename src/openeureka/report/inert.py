"""Templates whose values are inert, whoever wrote them.

A template engine escapes every value, terminal and direction controls are taken out on the way, and long texts are cut.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ..text import plain
from ..types import Sample
from . import charts, diff, tables, verdict
from .text import duration, number, scored
from .view import CandidateView

LIMITS = {"TEXT": 30_000, "CELL": 400, "NAME": 60}
"""Characters shown of a text, of a cell and of a name."""


@cache
def environment() -> Environment:
    """Of the folder `templates`, with all that reports show at hand."""
    environment = Environment(
        loader=PackageLoader("openeureka"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_inert,
    )
    environment.filters |= {"cut": cut, "number": number, "scored": scored, "duration": duration}
    environment.globals |= {
        "tables": tables,
        "verdict": verdict,
        "charts": charts,
        "diff": diff,
        "anchor": anchor,
        "name": tables.name,
    }
    environment.globals |= LIMITS | {key: getattr(charts, key) for key in ("WIDTH", "HEIGHT", "LEFT", "RIGHT")}
    return environment


def text(name: str) -> str:
    """A file of the folder as it is."""
    return (files("openeureka") / "templates" / name).read_text(encoding="utf-8")


def _inert(value: object) -> object:
    """Every value on its way into the page; the engine escapes it after this. Markup is what the template made."""
    return value if isinstance(value, Markup) else plain(str(value))


def cut(text: str, limit: int) -> str:
    """At most `limit` characters of a text, and how many more there are."""
    more = len(text) - limit
    return text if more <= 0 else f"{text[:limit]} […] ({more:,} more characters are in the files of the run)"


def anchor(place: CandidateView | Sample) -> str:
    """What a candidate is called in addresses."""
    return str(place.place)
