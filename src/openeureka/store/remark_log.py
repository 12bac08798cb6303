"""What a person said of a run, and which generation has heard it."""

from __future__ import annotations

from ..codec import DecodeError
from ..types import Remark
from .codec import decode_remark, encode_remark
from .db import Database, changed_row


class RemarkLog:
    """Remarks in the order in which they were made; each enters the history of one generation, for good."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def say(self, *remarks: Remark) -> None:
        """Commit what a person said, all or none; it counts for the generation that is asked for next."""
        self._database.put("remarks", *map(encode_remark, remarks))

    def unheard(self) -> tuple[Remark, ...]:
        """What was said and entered no history yet."""
        return self._between(self._last_heard())

    def hear(self, generation: int) -> tuple[Remark, ...]:
        """Close the remarks on a generation: what is unheard is part of its history from now on, later ones are not."""
        rows = self._database.rows("remarks", order=("id",))
        self._database.put("heard", {"generation": generation, "remarks": rows[-1]["id"] if rows else 0})
        remarks = self.heard(generation)
        assert remarks is not None
        return remarks

    def heard(self, generation: int) -> tuple[Remark, ...] | None:
        """What a person said after a generation; None when it may still be added to."""
        row = self._database.row("heard", generation=generation)
        return self._between(self._last_heard(before=generation), row["remarks"]) if row is not None else None

    def _last_heard(self, before: int | None = None) -> int:
        """Id of the last remark that a generation (earlier than `before`) has heard; ids begin with 1."""
        closed = self._database.rows("heard")
        return max((r["remarks"] for r in closed if before is None or r["generation"] < before), default=0)

    def _between(self, after: int, last: int | None = None) -> tuple[Remark, ...]:
        rows = self._database.rows("remarks", order=("id",))
        try:
            return tuple(
                decode_remark(dict(row)) for row in rows if row["id"] > after and (last is None or row["id"] <= last)
            )
        except DecodeError as error:
            raise changed_row(self._database.directory, error) from None
