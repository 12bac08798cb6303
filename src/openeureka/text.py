"""Makes text that a model, a program or a file wrote safe to show, to send and to keep."""

from __future__ import annotations

import re
import unicodedata

MAX_TEXT = 1 << 20
"""Characters that are kept of a text."""

# Whole escape sequences first, so that their printable rest (`[31m`, a window title) goes too.
_ESCAPES = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b[\]PX^_].*?(?:\x07|\x1b\\|$)|\x1b[^\n]?", re.DOTALL)
_HIDDEN = {"Cc", "Cf", "Cs", "Co"}  # controls, bidirectional and zero-width marks, surrogates, private use


def plain(text: str) -> str:
    """For a terminal, a page or a prompt: no escapes, control characters and invisible marks, but newlines and tabs."""
    if text.isprintable():  # most are, and a page asks for thousands
        return text
    bare = _ESCAPES.sub("", text)
    return "".join(c for c in bare if c in "\n\t" or unicodedata.category(c) not in _HIDDEN)


def one_line(text: str, width: int = 100) -> str:
    """The text on one line of at most `width` characters."""
    flat = " ".join(plain(text).split())
    return flat if len(flat) <= width else flat[: width - 1] + "…"


def printable(text: str, size: int = 500) -> str:
    """One printable line of at most `size` characters, for a message: a space for whatever is none of it."""
    return "".join(c if c.isprintable() else " " for c in text[: 4 * size]).strip()[:size]


def visible(text: str) -> str:
    r"""For a person who decides by it: what does not print is written out, as `\x1b`."""
    return text if text.isprintable() else ascii(text)


def safe_text(text: str) -> str:
    """For a store: what UTF-8 and SQLite can hold, capped, without lone surrogates and NUL."""
    return text[:MAX_TEXT].encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")


def nameable(text: str) -> str:
    """A text with a space for each character that no name in Python may hold."""
    return "".join(char if f"_{char}".isidentifier() else " " for char in text)
