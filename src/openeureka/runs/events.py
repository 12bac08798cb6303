"""What a Python program is told of a run while it is at work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ..observer import Phase
from ..score import Outcome
from ..types import Evaluation, Generation, Reply, Sample, TrainingProgress, TrainingResult
from .run import Run


@dataclass(frozen=True, slots=True)
class Started:
    """The run has its directory; what earlier processes left there is kept."""

    run: Run


@dataclass(frozen=True, slots=True)
class Began:
    """A phase begins; `final`, `polish` and `evaluate` come with the number of generations, `feedback` waits for a
    person."""

    generation: int
    phase: Phase


@dataclass(frozen=True, slots=True)
class Asked:
    """The model begins to write for these slots; some of them for another time."""

    slots: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Replied:
    """A reply arrived and is stored."""

    generation: int
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


Event = Started | Began | Asked | Replied | Checked | TrainingProgress | TrainingResult | Played | Generation | Outcome
"""In the order in which it happens, and after it is stored. `TrainingProgress` comes about once a second while lanes
train, a `TrainingResult` when one of them is done, a `Generation` when all of it is, the `Outcome` when a search is."""


class Teller:
    """An observer that makes an event of all it sees."""

    def __init__(self, tell: Callable[[Event], object]) -> None:
        self._tell = tell

    def phase(self, generation: int, name: Phase) -> None:
        self._tell(Began(generation, name))

    def asked(self, slots: Sequence[int]) -> None:
        self._tell(Asked(tuple(slots)))

    def reply(self, generation: int, slot: int, reply: Reply) -> None:
        self._tell(Replied(generation, slot, reply))

    def verdict(self, sample: Sample) -> None:
        self._tell(Checked(sample))

    def progress(self, progress: TrainingProgress) -> None:
        self._tell(progress)

    def result(self, result: TrainingResult) -> None:
        self._tell(result)

    def played(self, scores: Mapping[str, Evaluation]) -> None:
        self._tell(Played(dict(scores)))

    def generation(self, generation: Generation) -> None:
        self._tell(generation)

    def outcome(self, outcome: Outcome) -> None:
        self._tell(outcome)
