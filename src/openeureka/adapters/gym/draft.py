"""An environment of others as a task file: what rewards may read stands in it, for a person to rename, hide or add."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import jinja2

from ...types import StateVar

if TYPE_CHECKING:
    from .task import PaidTask

_WIDTH = 120


def template(name: str) -> jinja2.Template:
    """A file of `templates/` that makes Python."""
    text = (files("openeureka") / "templates" / name).read_text(encoding="utf-8")
    made = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return made.from_string(text)


def draft(task: type[PaidTask], name: str, own: str, intent: str = "") -> str:
    """A file with one class, which trains as the environment itself does.

    Args:
        task: its class.
        name: of the class in the file.
        own: what the task is called.
        intent: the sentence that a language model reads; empty for that of the documentation.
    """
    return template("adapter.py.jinja").render(
        env=task.env,
        name=name,
        own=own,
        description=(intent or task.description).replace("\\", "/").replace('"', "'"),
        places=[(variable, _place(place)) for variable, place in task.places.items()],
        variables=[_declared(variable) for variable in task.spec.variables],
        example=next((variable for variable, _ in task.places.items()), "obs_buf"),
    )


def _place(place: slice | str) -> str:
    return f'"{place}"' if isinstance(place, str) else f"slice({place.start}, {place.stop})"


def _declared(variable: StateVar) -> str:
    """Its line, or lines, of the state table."""
    words = [f'name="{variable.name}"', f"meaning={_quoted(variable.meaning)}"]
    words[1:1] = [f"shape={variable.shape}"] if variable.shape else []
    words += [f'use="{variable.use}"'] if variable.use != "raw" else []
    line = f"StateVar({', '.join(words)}),"
    if len(line) + 12 <= _WIDTH:
        return line
    return "\n".join(("StateVar(", *(f"                {word}," for word in words), "            ),"))


def _quoted(text: str) -> str:
    plain = " ".join(text.split()).replace("\\", "/")
    return repr(plain) if '"' in plain else f'"{plain}"'
