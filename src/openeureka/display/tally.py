"""What everything that follows a run at work counts of it."""

from __future__ import annotations

import time

from ..config import RunConfig, short_name
from ..events import Began, Event, Phase, Replied
from ..numbers import duration
from ..refine.tuned import rounds
from ..types import Generation, Usage

_PHASES: dict[Phase, str] = {
    "sample": "asking the model",
    "check": "checking programs",
    "train": "training",
    "play": "playing the policies",
    "feedback": "waiting for a person",
    "final": "training the leading rewards again",
    "polish": "training the best policy further",
    "evaluate": "scoring on held-out episodes",
}
_PARTS: dict[Phase, str] = {"sample": "ask", "check": "ask", "train": "train"}
"""The parts that the time of a generation is split into. How long a person takes cannot be foreseen."""


class Tally:
    """Phases, times and usage of a run at work."""

    def __init__(self, config: RunConfig, usage: Usage) -> None:
        self.config = config
        self.usage = usage
        self.generation: int | None = None
        """The generation under way."""
        self.stage, self.doing = "", "starting"
        self.started = time.monotonic()
        self.durations: list[dict[str, float]] = []
        """[s] of each generation that this process has finished, by part (see `_PARTS`)."""
        self._spent: dict[str, float] = {}
        self._part, self._part_started = "", self.started

    def hear(self, event: Event) -> None:
        match event:
            case Began():
                self._begin(event)
            case Replied(reply=reply):
                self.usage += reply.usage
            case Generation() if self.doing != "starting":  # else an earlier process finished it
                self._clock()
                self.durations.append(self._spent)
            case _:
                pass

    def _begin(self, began: Began) -> None:
        self._clock()
        if began.generation != self.generation:
            self.generation, self._spent = began.generation, {}
        self._part = _PARTS.get(began.phase, "")
        self.stage, self.doing = self._stage(began), _PHASES[began.phase]

    def _stage(self, began: Began) -> str:
        """The generation, or the round of a tuning; empty where given rewards train."""
        if began.generation is not None:
            return f"generation {began.generation} (0 to {self.config.generations - 1})"
        if began.round is not None:
            return f"round {began.round} (0 to {len(rounds(self.config)) - 1})"
        return "final" if self.config.generations or self.config.tune else ""

    def _clock(self) -> None:
        """Add the time since the last call to the part that is under way."""
        now = time.monotonic()
        self._spent[self._part] = self._spent.get(self._part, 0.0) + now - self._part_started
        self._part_started = now

    def remaining(self) -> float | None:
        """[s] left for the generations, estimated from those done; None before the first is done and after the last.

        Asking and training are estimated apart: a model that takes its time does not make the training shorter.
        """
        if not self.durations or self.generation is None:
            return None
        self._clock()
        mean = {part: sum(d.get(part, 0.0) for d in self.durations) / len(self.durations) for part in ("ask", "train")}
        ahead = ("train",) if self._part == "train" else ("ask", "train")
        now = sum(max(0.0, mean[part] - self._spent.get(part, 0.0)) for part in ahead)
        return now + (self.config.generations - self.generation - 1) * sum(mean.values())

    def headline(self) -> str:
        left = self.remaining()
        spent = self.usage.prompt_tokens + self.usage.completion_tokens
        parts = (
            short_name(self.config.env),
            self.stage,
            self.doing,
            duration(time.monotonic() - self.started),
            f"about {duration(left)} of search left" if left else "",
            f"{spent:,} tokens" if self.config.generations else "",
            f"US$ {self.usage.cost_usd:.4f}" if self.usage.cost_usd else "",
        )
        return " · ".join(part for part in parts if part)
