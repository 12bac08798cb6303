"""What a run tells while it goes on. A run that nobody listens to is the same run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from .score import Outcome
from .types import Evaluation, Generation, Reply, Sample, TrainingProgress, TrainingResult

Phase = Literal["sample", "check", "train", "play", "feedback", "final", "polish", "evaluate"]


@dataclass(frozen=True, slots=True)
class Began:
    """A phase begins: of a generation, of a round in which `tune` tries numbers, or of what has neither, as the final
    trainings. `feedback` waits for a person."""

    phase: Phase
    generation: int | None = None
    round: int | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """The model begins to write for these slots; some of them for another time."""

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
    """What lanes score by now, by id, since their policies were played; the stored ones come again."""

    scores: Mapping[str, Evaluation]


Event = Began | Asked | Replied | Checked | TrainingProgress | TrainingResult | Played | Generation | Outcome
"""In the order in which it happens, and after it is stored. `TrainingProgress` comes about once a second while lanes
train, a `TrainingResult` when one of them is done, a `Generation` when all of it is, the `Outcome` when a search is. A
resumed run begins with the generations that it found in the store."""

Tell = Callable[[Event], object]
"""Called from the thread of the run; must return soon. What it raises ends the run, and KeyboardInterrupt stops it as
Ctrl-C does."""


def nobody(event: Event) -> None:
    """Looks away."""


def everyone(*listeners: Tell) -> Tell:
    """Tells several, in order."""

    def tell(event: Event) -> None:
        for listener in listeners:
            listener(event)

    return tell
