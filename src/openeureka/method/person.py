"""The wait for a person between two generations."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Protocol

from ..config import RunConfig
from ..errors import FeedbackError, ModelError
from ..events import Began, Tell
from ..store import Store, read_remarks
from ..store.directory import check
from ..types import Generation, History, RemarkKind

POLL = 0.5
"""[s] between two checks for remarks that were made elsewhere."""


class Desk(Protocol):
    """Where the person who started the run may answer. Like all others, remarks made there reach the store by `say`."""

    def invite(self, generation: Generation) -> None:
        """Invite the person to judge a generation, once its policies can be watched."""
        ...

    def listen(self, seconds: float) -> None:
        """Wait for so many seconds, less when something is said here."""
        ...


@dataclass(frozen=True, slots=True)
class Hearing:
    """Adds to a history what a person says of its last generation.

    Every remark is committed when it is said. One more row then closes the list of those that count for the next
    prompt. A run that is killed while it waits will wait again and has lost nothing.
    """

    config: RunConfig
    store: Store
    desk: Desk
    tell: Tell

    def hear(self, history: History) -> History:
        """The history with the remarks on its last generation, if a person is to be heard and has not been yet."""
        index = len(history.generations) - 1
        if not 0 <= index < self.config.hearings or self.store.remarks.heard(index) is not None:
            return history
        if self.config.model.startswith("replay:"):
            self._repeat(index)
        else:
            self._wait(history.generations[index])
        return history.heard(self.store.remarks.hear(index))

    def _repeat(self, index: int) -> None:
        """Repeat what was said in the replayed run."""
        recorded = read_remarks(self.config.model.removeprefix("replay:")).get(index, ())
        if self.store.remarks.unheard()[-len(recorded) :] == recorded:
            return  # a replay that was killed here has them: all or none are committed
        try:
            check(self.store, recorded)
        except FeedbackError as error:
            raise ModelError(
                f"The feedback that {self.config.model} replays does not fit this run: {error} Use the same env, "
                "sample, iteration, repair, refill and seed as there."
            ) from None
        self.store.remarks.say(*recorded)

    def _wait(self, generation: Generation) -> None:
        """Wait until somebody says `go`, at most for `feedback_timeout`."""
        self.tell(Began("feedback", generation.index))
        self.desk.invite(generation)
        end = time.monotonic() + (self.config.feedback_timeout or math.inf)
        while (
            all(remark.kind is not RemarkKind.GO for remark in self.store.remarks.unheard()) and time.monotonic() < end
        ):
            self.desk.listen(min(POLL, self.config.feedback_timeout or POLL))
