"""Sends a page that is open only those of its parts that changed."""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from .folder import Fingerprint

PAUSE = 2.0
"""[s] between two looks of a page."""
SHARE = 0.03
"""Of one core, which following may take while a run changes all the time."""
REMEMBERED = 64
"""Versions of pages. Who shows an older one is sent all parts."""

Parts = Mapping[str, str]
"""HTML of a page's parts by name, in the page's order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """A page as it was at one time."""

    tag: str
    parts: Parts
    pause: float
    """[s] that a page should wait before it looks again: the longer, the more this version cost to make."""

    def since(self, earlier: Version | None) -> dict[str, object]:
        """What leads from an earlier version to this one, as JSON."""
        known = earlier.parts if earlier is not None else {}
        changed = {name: html for name, html in self.parts.items() if known.get(name) != html}
        return {"tag": self.tag, "order": list(self.parts), "changed": changed}


class Versions:
    """The newest version of each page that somebody looks at, and some earlier ones."""

    def __init__(self) -> None:
        self._newest: OrderedDict[str, tuple[Fingerprint, Version]] = OrderedDict()
        self._earlier: OrderedDict[str, Version] = OrderedDict()

    def newest(self, page: str, fingerprint: Fingerprint, render: Callable[[], Parts]) -> Version:
        """The page, rendered only where what it shows has changed."""
        held = self._newest.get(page)
        if held is not None and held[0] == fingerprint:
            return held[1]
        begun = time.process_time()
        parts = render()
        cost = time.process_time() - begun
        version = Version(tag=_tag(parts), parts=parts, pause=max(PAUSE, cost / SHARE))
        _keep(self._newest, page, (fingerprint, version))
        _keep(self._earlier, version.tag, version)
        return version

    def earlier(self, tag: str) -> Version | None:
        return self._earlier.get(tag)


def _tag(parts: Parts) -> str:
    digest = hashlib.sha256()
    for name, html in parts.items():
        digest.update(f"{name}\0{html}\0".encode())
    return digest.hexdigest()[:16]


Value = TypeVar("Value")


def _keep(kept: OrderedDict[str, Value], key: str, value: Value) -> None:
    kept[key] = value
    kept.move_to_end(key)
    while len(kept) > REMEMBERED:
        kept.popitem(last=False)
