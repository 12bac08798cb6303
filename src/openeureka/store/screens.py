"""What the screen decided of the slots of a generation."""

from __future__ import annotations

from collections.abc import Iterable

from ..types import Place, Screened
from .codec import decode_screened, encode_screened
from .db import Database


class ScreenLog:
    """Decisions of a store, all those of a generation at once: they are made among its slots."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def save(self, decisions: Iterable[Screened]) -> None:
        self._database.put("screens", *map(encode_screened, decisions))

    def all(self) -> dict[Place, Screened]:
        """By slot; those of a slot without an accepted program, or in a generation without a screen, are not there."""
        rows = self._database.rows("screens", order=("generation", "slot"))
        decisions = [self._database.decoded(decode_screened, dict(row)) for row in rows]
        return {decision.place: decision for decision in decisions}
