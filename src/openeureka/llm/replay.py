"""The replies of a finished search, given again in the order in which they were asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

from ..errors import ModelError
from ..types import Prompt, Reply


class ReplayModel:
    """Re-runs a search offline. Replies were paid for once, so they cost nothing here.

    Args:
        replies: all of the other run's, in its order.
        style: that of the model which gave them.
        held: how many of them this run already has, when it is resumed.
    """

    name = "replay"

    def __init__(self, replies: Sequence[Reply], style: Literal["free", "grammar"], *, held: int = 0) -> None:
        self.style: Literal["free", "grammar"] = style
        self._replies = replies
        self._next = held

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield the next n replies, whatever is asked.

        Raises:
            ModelError: when the recording ends earlier than this run.
        """
        for _ in range(n):
            if self._next >= len(self._replies):
                raise ModelError(
                    f"The replayed run holds {len(self._replies)} replies and this one needs more; give it the same "
                    "env, sample, iteration, search and seed."
                )
            reply = self._replies[self._next]
            self._next += 1
            yield replace(reply, usage=replace(reply.usage, cost_usd=0.0))

    def close(self) -> None:
        """Holds nothing."""
