"""Makes text that a model, a program or a file wrote safe to show, to send and to keep."""

from __future__ import annotations

import re
import unicodedata

MAX_TEXT = 1 << 20
"""Most characters that are kept of a text."""

# Whole escape sequences first, so that their printable rest (`[31m`, a window title) goes too.
_ESCAPES = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b[\]PX^_].*?(?:\x07|\x1b\\|$)|\x1b[^\n]?", re.DOTALL)
_HIDDEN = {"Cc", "Cf", "Cs", "Co"}  # controls, bidirectional and zero-width marks, surrogates, private use


def plain(text: str) -> str:
    """For a terminal, a page or a prompt: no escapes, control characters or invisible marks; newlines and tabs stay."""
    if text.isprintable():  # most texts are, and a page has thousands
        return text
    bare = _ESCAPES.sub("", text)
    return "".join(c for c in bare if c in "\n\t" or unicodedata.category(c) not in _HIDDEN)


def one_line(text: str, width: int = 100) -> str:
    """The text on one line of at most `width` characters."""
    flat = " ".join(plain(text).split())
    return flat if len(flat) <= width else flat[: width - 1] + "…"


def printable(text: str, size: int = 500) -> str:
    """One printable line of at most `size` characters, for a message: other characters become spaces."""
    return "".join(c if c.isprintable() else " " for c in text[: 4 * size]).strip()[:size]


def visible(text: str) -> str:
    r"""For a person who has to judge the text: if a character does not print, it is written out, as `\x1b`."""
    return text if text.isprintable() else ascii(text)


def safe_text(text: str) -> str:
    """For a store: capped, and without lone surrogates and NUL, which UTF-8 and SQLite cannot hold."""
    return text[:MAX_TEXT].encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")


def nameable(text: str) -> str:
    """The text with a space for each character that a name in Python cannot contain."""
    return "".join(char if f"_{char}".isidentifier() else " " for char in text)
