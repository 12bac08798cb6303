"""Events that a run reports while it goes on. A run that nobody listens to is the same run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from .score import Outcome
from .types import Evaluation, Generation, Reply, Sample, TrainingProgress, TrainingResult

Phase = Literal["sample", "check", "train", "play", "feedback", "final", "polish", "evaluate"]


@dataclass(frozen=True, slots=True)
class Began:
    """A phase begins: of a generation, of a round in which `tune` tries numbers, or of neither, such as the final
    trainings. In the phase `feedback` the run waits for a person."""

    phase: Phase
    generation: int | None = None
    round: int | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """The model begins to write for these slots. A slot may be asked for more than once."""

    slots: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Replied:
    """A reply arrived and is stored."""

    slot: int
    reply: Reply


@dataclass(frozen=True, slots=True)
class Checked:
    """A slot's newest program was checked; a refused one may be followed by another for the same slot."""

    sample: Sample


@dataclass(frozen=True, slots=True)
class Played:
    """Scores of lanes, by id, after their policies were played. Scores from the store are reported again."""

    scores: Mapping[str, Evaluation]


Event = Began | Asked | Replied | Checked | TrainingProgress | TrainingResult | Played | Generation | Outcome
"""Events come in the order in which things happen, each after it is stored. `TrainingProgress` comes about once a
second while lanes train, a `TrainingResult` when a lane is done, a `Generation` when all of it is done, the `Outcome`
when a search is. A resumed run begins with the generations that it found in the store."""

Tell = Callable[[Event], object]
"""A listener, called from the thread of the run; it must return soon. What it raises ends the run, and
KeyboardInterrupt stops it as Ctrl-C does."""


def nobody(event: Event) -> None:
    """A listener that ignores every event."""


def everyone(*listeners: Tell) -> Tell:
    """One listener that tells several, in order."""

    def tell(event: Event) -> None:
        for listener in listeners:
            listener(event)

    return tell
