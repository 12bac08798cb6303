"""Templates of the Python files that are drafted, and how a state table is written."""

from __future__ import annotations

from importlib.resources import files

import jinja2

_ROOM = 108
"""Characters of a line, without its indentation."""


def template(name: str) -> jinja2.Template:
    """A file of `templates/` that makes Python."""
    text = (files("openeureka") / "templates" / name).read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return environment.from_string(text)


def declared(name: str, meaning: str, shape: tuple[int, ...], use: str) -> str:
    """The source line, or lines, that declare a state variable.

    Args:
        meaning: as a Python literal, quotes included.
        shape: of one world's value; () for a number.
        use: as in `types.StateVar`.
    """
    words = [f'"{name}"', meaning, *([f"{shape}"] if shape else [])]
    words += [f'use="{use}"'] if use != "raw" else []
    line = f"StateVar({', '.join(words)}),"
    if len(line) <= _ROOM:
        return line
    return "\n".join(("StateVar(", *(f"                {word}," for word in words), "            ),"))
