"""What became of slots before they trained: what the model was asked and replied, and what the screen decided."""

from __future__ import annotations

from collections.abc import Iterable

from ..codec import encode
from ..types import GIVEN, Message, Place, Prompt, Reply, Screened, Usage
from . import artifacts
from .db import Log
from .rows import (
    decode_messages,
    decode_place,
    decode_reply,
    decode_screened,
    encode_messages,
    encode_place,
    encode_reply,
    encode_screened,
)


class TalkLog(Log):
    """Prompts and replies by slot, and the model's proposals of ranges. A reply is stored before anything else is done
    with it."""

    def save_prompt(self, generation: int, slots: range, prompt: Prompt, parent: Place | None) -> None:
        """Store a prompt, its slots and the candidate to improve. `messages.json` shows people all prompts."""
        if self._database.row("prompts", generation=generation, slot=slots.start) is None:
            messages = encode_messages(prompt.messages)
            self._database.put("prompts", {"generation": generation, "slot": slots.start, "messages": messages})
        self.save_slots(generation, slots, asked=slots.start, parent=parent)
        asked = [
            {"generation": generation, "slot": slot, "messages": messages}
            for (generation, slot), messages in self.prompts().items()
        ]
        artifacts.write(self._directory, "messages.json", encode(asked, indent=2))

    def save_slots(self, generation: int, slots: range, *, asked: int | None, parent: Place | None) -> None:
        """Store for some slots which prompt fills them, by its first slot, and which candidate it asks to improve."""
        known = {row["slot"] for row in self._database.rows("slots", generation=generation)}
        row = {"generation": generation, "prompt": asked, **encode_place(parent, "parent_")}
        self._database.put("slots", *(row | {"slot": slot} for slot in slots if slot not in known))

    def save_reply(self, generation: int, attempt: int, slot: int, reply: Reply) -> None:
        place = {"generation": generation, "attempt": attempt, "slot": slot}
        self._database.put("replies", place | encode_reply(reply))

    def reply(self, generation: int, attempt: int, slot: int) -> Reply | None:
        row = self._database.row("replies", generation=generation, attempt=attempt, slot=slot)
        return decode_reply(row) if row is not None else None

    def replies(self) -> tuple[Reply, ...]:
        """Every reply in the order in which a run asks for them: all attempts at one prompt, then those at the next.
        Given rewards are left out: no model was asked for them."""
        asked = {(row["generation"], row["slot"]): row["prompt"] or 0 for row in self._database.rows("slots")}

        def turn(place: tuple[int, int, int]) -> tuple[int, int, int, int]:
            generation, attempt, slot = place
            return generation, asked.get((generation, slot), 0), attempt, slot

        placed = self.placed_replies()
        return tuple(placed[place] for place in sorted(placed, key=turn) if placed[place].model != GIVEN)

    def placed_replies(self) -> dict[tuple[int, int, int], Reply]:
        """Every reply by generation, attempt and slot, in that order."""
        rows = self._database.rows("replies", order=("generation", "attempt", "slot"))
        return {(row["generation"], row["attempt"], row["slot"]): decode_reply(row) for row in rows}

    def prompts(self) -> dict[tuple[int, int], tuple[Message, ...]]:
        """The messages of each prompt, by generation and the first slot that the prompt fills."""
        rows = self._database.rows("prompts", order=("generation", "slot"))
        return {
            (row["generation"], row["slot"]): self._database.decoded(decode_messages, row["messages"]) for row in rows
        }

    def parents(self) -> dict[Place, Place]:
        """The candidate that the model was asked to improve, by slot. Slots without a parent are left out."""
        return {
            Place(row["generation"], row["slot"]): parent
            for row in self._database.rows("slots")
            if (parent := decode_place(row, "parent_")) is not None
        }

    def usage(self) -> Usage:
        """Tokens and money spent so far, over all resumptions."""
        return sum((reply.usage for reply in self.paid()), Usage())

    def paid(self) -> tuple[Reply, ...]:
        """Every reply of a model, to prompts for rewards and to prompts for ranges."""
        return (*self.replies(), *self.proposals().values())

    def save_proposal(self, slot: int, attempt: int, asked: Prompt, reply: Reply) -> None:
        """Store a reply to a prompt for ranges, before anything else is done with it."""
        row = {"slot": slot, "attempt": attempt, "messages": encode_messages(asked.messages)}
        self._database.put("proposals", row | encode_reply(reply))

    def proposals(self) -> dict[tuple[int, int], Reply]:
        """The replies to prompts for ranges, by slot and attempt."""
        rows = self._database.rows("proposals", order=("slot", "attempt"))
        return {(row["slot"], row["attempt"]): decode_reply(row) for row in rows}


class ScreenLog(Log):
    """The screen's decisions. Those of a generation are saved at once, because they compare its slots."""

    def save(self, decisions: Iterable[Screened]) -> None:
        self._database.put("screens", *map(encode_screened, decisions))

    def all(self) -> dict[Place, Screened]:
        """Decisions by slot. Slots without an accepted program and generations without a screen have none."""
        rows = self._database.rows("screens", order=("generation", "slot"))
        decisions = [self._database.decoded(decode_screened, row) for row in rows]
        return {decision.place: decision for decision in decisions}
