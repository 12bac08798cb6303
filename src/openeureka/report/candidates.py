"""The slots of a search: the programs they hold, where those came from and what became of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from .. import strategies
from ..config import RunConfig
from ..method import screen
from ..method.sampling import NO_PROGRAM
from ..store import Store
from ..types import (
    Candidate,
    Evaluation,
    History,
    Message,
    Place,
    Remark,
    Reply,
    Sample,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
    VerdictCode,
    lane_id,
)


class CandidateState(StrEnum):
    """How far a slot has come."""

    DRAWN = "drawn"  # a reply is there, its program is not judged yet
    REFUSED = "refused"
    ACCEPTED = "accepted"  # not trained yet
    SCREENED = "screened"  # it could train, and others were preferred
    TRAINED = "trained"
    CUT = "cut"  # others played better, and trained on
    DIVERGED = "diverged"
    FAILED = "failed"


_TRAINED = {
    TrainingState.FINISHED: CandidateState.TRAINED,
    TrainingState.CUT: CandidateState.CUT,
    TrainingState.DIVERGED: CandidateState.DIVERGED,
    TrainingState.FAILED: CandidateState.FAILED,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptView:
    """One reply for a slot, and what was found in it."""

    repair: tuple[Message, ...]
    """The messages that a repair turn added to the generation's prompt; empty for a fresh sample."""
    reply: Reply
    program: Candidate | None
    verdict: Verdict | None
    """None: not judged yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateView:
    """A slot of a generation: the program it holds, where it came from and what became of it."""

    generation: int
    slot: int
    program: Candidate | None
    """The program of the last reply; None when that held none."""
    verdict: Verdict | None
    result: TrainingResult | None = None
    played: Evaluation | None = None
    """Score of its policy in the episodes that rewards are ranked by."""
    feedback: str = ""
    """What the model is told about it when it becomes a parent."""
    parent: Sample | None = None
    """The program that the prompt asked to improve."""
    attempts: tuple[AttemptView, ...] = ()
    video: str = ""
    """Path in the run directory; empty when there is none."""
    strength: float | None = None
    """Bradley-Terry strength by a person's votes; None where it took part in none."""
    vetoed: bool = False

    @property
    def place(self) -> Place:
        return Place(self.generation, self.slot)

    @property
    def state(self) -> CandidateState:
        if self.result is not None:
            return _TRAINED[self.result.state]
        if self.verdict is None:
            return CandidateState.DRAWN
        if self.verdict.code is VerdictCode.SCREENED:
            return CandidateState.SCREENED
        return CandidateState.ACCEPTED if self.verdict.accepted else CandidateState.REFUSED

    @property
    def fitness(self) -> float | None:
        """F in training, its maximum over epochs."""
        return self.result.fitness if self.result is not None else None

    @property
    def score(self) -> float | None:
        """What ranks it: F of its policy when played, or else F in training."""
        return self.played.fitness if self.played is not None else self.fitness

    @property
    def usage(self) -> Usage:
        """Tokens and money for all replies of the slot."""
        return sum((attempt.reply.usage for attempt in self.attempts), Usage())

    def _repr_html_(self) -> str:
        """For a notebook."""
        from .html import notebook  # which imports this module

        return notebook("candidate", self)


@dataclass(frozen=True, slots=True, kw_only=True)
class PromptView:
    """What the model was asked for the slots from `slot` on."""

    slot: int
    messages: tuple[Message, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GenerationView:
    """One generation, finished or under way."""

    index: int
    candidates: tuple[CandidateView, ...]
    prompts: tuple[PromptView, ...] = ()
    finished: bool = True
    remarks: tuple[Remark, ...] = ()
    """What a person said after it."""


class Reader:
    """Puts together what the store keeps in separate tables."""

    def __init__(
        self,
        store: Store,
        config: RunConfig,
        history: History,
        results: Mapping[str, TrainingResult],
        played: Mapping[str, Evaluation],
        videos: Mapping[str, str],
    ) -> None:
        self._store, self._config, self._history = store, config, history
        self._results, self._played, self._videos = results, played, videos
        self._entries = {entry.sample.place: entry for entry in history.entries}
        self._parents = {} if config.model == "random" else store.talk.parents()  # model=random ignores its parent
        self._attempts, self._screens = store.rewards.attempts(), store.screens.all()
        self._ranking = strategies.Ranking(history)

    def generations(self) -> tuple[GenerationView, ...]:
        asked, replies = self._store.talk.prompts(), self._store.talk.placed_replies()
        done = len(self._history.generations)
        views = []
        for index in range(max((generation + 1 for generation, *_ in (*asked, *replies)), default=0)):
            requests = [
                PromptView(slot=slot, messages=messages)
                for (generation, slot), messages in asked.items()
                if generation == index
            ]
            drawn: dict[int, dict[int, Reply]] = {}
            for (generation, attempt, slot), reply in replies.items():
                if generation == index:
                    drawn.setdefault(slot, {})[attempt] = reply
            candidates = [self._candidate(Place(index, slot), drawn[slot]) for slot in sorted(drawn)]
            views.append(
                GenerationView(
                    index=index,
                    candidates=tuple(candidates),
                    prompts=tuple(requests),
                    finished=index < done,
                    remarks=self._history.generations[index].remarks if index < done else (),
                )
            )
        return tuple(views)

    def _candidate(self, place: Place, replies: Mapping[int, Reply]) -> CandidateView:
        attempts = tuple(self._attempt(place, number, reply) for number, reply in replies.items())
        entry = self._entries.get(place)
        program = entry.sample.candidate if entry is not None else attempts[-1].program
        verdict = entry.sample.verdict if entry is not None else attempts[-1].verdict
        if entry is None and program is not None and place in self._screens and not self._screens[place].kept:
            verdict = screen.verdict(program.id, self._screens[place])
        lane = lane_id(program.id, self._config.seed) if program is not None else ""
        parent = self._entries.get(self._parents[place]) if place in self._parents else None
        return CandidateView(
            generation=place.generation,
            slot=place.slot,
            program=program,
            verdict=verdict,
            result=entry.result if entry is not None else self._results.get(lane),
            played=entry.played if entry is not None else self._played.get(lane),
            feedback=entry.feedback if entry is not None else "",
            parent=parent.sample if parent is not None else None,
            attempts=attempts,
            video=self._videos.get(lane, ""),
            strength=self._ranking.strengths.get(program.id) if program is not None else None,
            vetoed=program is not None and program.id in self._ranking.rejected,
        )

    def _attempt(self, place: Place, number: int, reply: Reply) -> AttemptView:
        found = self._attempts.get((place.generation, number, place.slot))
        if found is None:
            return AttemptView(repair=(), reply=reply, program=None, verdict=None)
        verdict = self._store.rewards.verdict(found.candidate.id) if found.candidate is not None else NO_PROGRAM
        return AttemptView(repair=found.repair, reply=reply, program=found.candidate, verdict=verdict)
