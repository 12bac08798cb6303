"""How drafted files are written: their templates, and names and values as Python."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Sequence
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


def identifier(name: str) -> str:
    """A name that rewards may use: in ASCII, without accents, and never with two leading underscores."""
    ascii = "".join(char for char in unicodedata.normalize("NFKD", name) if not unicodedata.combining(char))
    found = re.sub(r"\W", "_", ascii, flags=re.ASCII).lstrip("_") or "part"
    return f"_{found}" if found[0].isdigit() else found


def quoted(name: str) -> str:
    """A name as a Python literal, whatever characters it has."""
    return json.dumps(name, ensure_ascii=False)


def columns(indices: Sequence[int]) -> str:
    """Python code that picks columns: a slice where they are consecutive, else a list."""
    first, last = indices[0], indices[-1]
    return f"{first}:{last + 1}" if list(indices) == list(range(first, last + 1)) else f"{list(indices)}"


def number(value: float) -> str:
    """With six digits."""
    return repr(float(f"{value:.6g}"))


def tuple_of(items: Sequence[str]) -> str:
    """A tuple of these items, in lines of 120 characters."""
    if len(items) > 1 and len(set(items)) == 1:
        return f"({items[0]},) * {len(items)}"
    lines = [""]
    for item in items:
        if len(lines[-1]) + len(item) > 100:
            lines.append("")
        lines[-1] += f"{item}, "
    if len(lines) == 1:
        return f"({lines[0].strip() if len(items) == 1 else lines[0].rstrip(', ')})"
    return "(\n" + "".join(f"    {line.rstrip()}\n" for line in lines) + ")"
