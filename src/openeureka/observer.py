"""What a live display is told. A run without one is the same run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol

from .score import Outcome
from .types import Evaluation, Generation, Reply, Sample, TrainingProgress, TrainingResult

Phase = Literal["sample", "check", "train", "play", "feedback", "final", "polish", "evaluate"]


class Observer(Protocol):
    """Called from the thread of the run, in the order of events, after what they tell is stored; must return soon.

    What one raises ends the run, and KeyboardInterrupt stops it as Ctrl-C does.
    """

    def phase(self, generation: int, name: Phase) -> None:
        """A phase begins: of a generation, of a round of `tune` (counted on from the last generation), or of what
        follows both. `feedback` waits for a person."""
        ...

    def asked(self, slots: Sequence[int]) -> None:
        """The model begins to write for these slots; some of them for another time."""
        ...

    def reply(self, generation: int, slot: int, reply: Reply) -> None:
        """A reply arrived and is stored."""
        ...

    def verdict(self, sample: Sample) -> None:
        """A slot's newest program was checked; a refused one may be followed by another for the same slot."""
        ...

    def progress(self, progress: TrainingProgress) -> None: ...

    def result(self, result: TrainingResult) -> None:
        """A lane's training ended and is stored."""
        ...

    def played(self, scores: Mapping[str, Evaluation]) -> None:
        """What lanes score by now, by lane id, since their policies were played; the stored ones come again."""
        ...

    def generation(self, generation: Generation) -> None:
        """A generation is complete; a resumed run begins with one call for each that it found in the store."""
        ...

    def outcome(self, outcome: Outcome) -> None: ...


class Observers:
    """Tells several, in order."""

    def __init__(self, *observers: Observer) -> None:
        self._observers = observers

    def phase(self, generation: int, name: Phase) -> None:
        for observer in self._observers:
            observer.phase(generation, name)

    def asked(self, slots: Sequence[int]) -> None:
        for observer in self._observers:
            observer.asked(slots)

    def reply(self, generation: int, slot: int, reply: Reply) -> None:
        for observer in self._observers:
            observer.reply(generation, slot, reply)

    def verdict(self, sample: Sample) -> None:
        for observer in self._observers:
            observer.verdict(sample)

    def progress(self, progress: TrainingProgress) -> None:
        for observer in self._observers:
            observer.progress(progress)

    def result(self, result: TrainingResult) -> None:
        for observer in self._observers:
            observer.result(result)

    def played(self, scores: Mapping[str, Evaluation]) -> None:
        for observer in self._observers:
            observer.played(scores)

    def generation(self, generation: Generation) -> None:
        for observer in self._observers:
            observer.generation(generation)

    def outcome(self, outcome: Outcome) -> None:
        for observer in self._observers:
            observer.outcome(outcome)


class NullObserver:
    """Looks away."""

    def phase(self, generation: int, name: Phase) -> None: ...
    def asked(self, slots: Sequence[int]) -> None: ...
    def reply(self, generation: int, slot: int, reply: Reply) -> None: ...
    def verdict(self, sample: Sample) -> None: ...
    def progress(self, progress: TrainingProgress) -> None: ...
    def result(self, result: TrainingResult) -> None: ...
    def played(self, scores: Mapping[str, Evaluation]) -> None: ...
    def generation(self, generation: Generation) -> None: ...
    def outcome(self, outcome: Outcome) -> None: ...
