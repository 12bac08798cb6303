"""Sends to an open page only those of its parts that changed."""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

PAUSE = 1.0
"""[s] between two looks at a run whose page is open."""
BLINK = 0.2
"""[s] after which the server notices that a page was closed."""
BEAT = 10.0
"""[s] without changes after which a page is sent a beat, so that either side notices a broken connection. The beat is a
named event, because scripts never see comments; `follow.js` waits for two and a half beats."""
SHARE = 0.01
"""Share of one core that reading and drawing a page may take while its run changes all the time; to look whether it has
changed may take nearly as much again."""
Fingerprint = tuple[object, ...]
"""Differs when what it stands for has changed."""
Parts = Mapping[str, str]
"""HTML of a page's parts by name, in the page's order."""
Value = TypeVar("Value")


class Fresh(Generic[Value]):
    """A cache of at most `size` values; each is made anew when its fingerprint differs."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._kept: dict[str, tuple[Fingerprint, Value]] = {}

    def get(self, key: str, fingerprint: Fingerprint, make: Callable[[Value | None], Value]) -> Value:
        """The value of the key; `make` is given the previous value."""
        before, value = self._kept.pop(key, ((), None))
        if value is None or before != fingerprint:
            value = make(value)
        self._kept[key] = fingerprint, value
        while len(self._kept) > self._size:
            del self._kept[next(iter(self._kept))]  # the least recently used
        return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A piece of a page."""

    name: str
    mark: str
    """Differs when the HTML does."""
    html: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """A page as it is now."""

    parts: tuple[Part, ...]
    pause: float
    """[s] until the page is looked at again: the longer, the more this version cost to make."""

    @staticmethod
    def make(render: Callable[[], Parts], before: Version | None = None) -> Version:
        """Render the page. The cost of the first version, which reads a run for the first time, does not count."""
        begun = time.thread_time()
        parts = tuple(Part(name=name, mark=_mark(name, html), html=html) for name, html in render().items())
        work = time.thread_time() - begun if before is not None else 0.0
        return Version(parts=parts, pause=max(PAUSE, work / SHARE))

    def beyond(self, marks: Sequence[str]) -> dict[str, object] | None:
        """The changes from a version whose parts have these marks to this one, for JSON; None where there are none."""
        if list(marks) == [part.mark for part in self.parts]:
            return None
        return {
            "order": [(part.name, part.mark) for part in self.parts],
            "changed": {part.mark: part.html for part in self.parts if part.mark not in marks},
        }


async def events(
    look: Callable[[], Version], shown: Sequence[str], gone: Callable[[], Awaitable[bool]]
) -> AsyncIterator[str]:
    """Server-sent events that bring an open page from the parts with the marks `shown` to every later version.

    Args:
        look: the page as it is now; the longer it takes, the less often it is called.
        gone: whether nobody listens any more.
    """
    due = heard = time.monotonic()
    while not await gone():
        changes = None
        if time.monotonic() >= due:
            begun = time.thread_time()
            version = look()
            due = time.monotonic() + max(version.pause, (time.thread_time() - begun) / SHARE)
            changes = version.beyond(shown)
            shown = [part.mark for part in version.parts]
        if changes is not None:
            yield f"data: {json.dumps(changes)}\n\n"
        elif time.monotonic() - heard >= BEAT:
            yield "event: beat\ndata: here\n\n"
        else:
            await asyncio.sleep(min(BLINK, PAUSE))
            continue
        heard = time.monotonic()


def _mark(name: str, html: str) -> str:
    """A mark of a part's name and HTML: with its HTML alone, two empty parts would share a mark."""
    return hashlib.sha256(f"{name}\0{html}".encode()).hexdigest()[:12]
