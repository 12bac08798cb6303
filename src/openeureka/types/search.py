"""Slots and generations of a search, what a person says of them, and how far the search has come."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Literal, NamedTuple

from .bounds import Finite
from .replies import Usage
from .rewards import Candidate, CandidateId, Verdict
from .training import Evaluation, Limits, TrainingResult, TrainingState

Ranks = Literal["played", "training"]
"""Which F ranks candidates: that of their policies when played, or its maximum over training."""
Word = Literal["", "better", "worse", "not decided", "nothing learnt", "no difference"]
"""What a search decided about its reward, compared with the human one; empty without scores to compare."""


class Place(NamedTuple):
    """A slot of a generation, by which people name a candidate: `g0s3`."""

    generation: int
    slot: int

    def __str__(self) -> str:
        return f"g{self.generation}s{self.slot}"


class RemarkKind(StrEnum):
    """What a person can say of a search."""

    WORDS = "words"
    FAVOURITE = "favourite"  # the parent of the next generation
    VETO = "veto"  # never a parent and never the best, for good
    VOTE = "vote"  # of two policies, the one that does the task better
    GO = "go"  # the search need not wait longer


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """One thing that a person said."""

    kind: RemarkKind
    text: str = ""
    """The words."""
    place: Place | None = None
    """The favourite, the vetoed one, or the one preferred in a vote."""
    over: Place | None = None
    """The other one of a vote."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What became of one slot of a generation."""

    generation: int
    slot: int
    candidate: Candidate | None
    verdict: Verdict
    attempts: int = 1
    """Replies spent on the slot, repairs included."""

    @property
    def place(self) -> Place:
        return Place(self.generation, self.slot)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """A slot with the result of its training (None: never trained), the score of its policy when played (None where a
    search ranks by training), and the feedback text made of both."""

    sample: Sample
    result: TrainingResult | None
    feedback: str
    played: Evaluation | None = None

    @property
    def fitness(self) -> float | None:
        """F in training, its maximum over epochs."""
        return self.result.fitness if self.result is not None else None

    @property
    def score(self) -> float | None:
        """The score that ranks it: F of its policy when played, or else F in training."""
        return self.played.fitness if self.played is not None else self.fitness

    @property
    def trained(self) -> bool:
        """Whether its training came to the end or was cut at a rung, with or without a defined F."""
        return self.result is not None and self.result.state in (TrainingState.FINISHED, TrainingState.CUT)

    @property
    def candidate_id(self) -> CandidateId:
        """Id of its program; slots with equal programs share it. Empty where the reply held no program."""
        return self.sample.verdict.candidate

    def breaks(self, limits: Limits) -> bool:
        """Whether its policy broke one of the limits when played."""
        return self.played is not None and bool(self.played.broken(limits))


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """What the screen decided about a slot, and the numbers behind it."""

    place: Place
    kept: bool
    """Whether it trains."""
    agreement: Finite | None
    """Rank correlation of its return with F, over recorded episodes; None where either is constant."""
    error: Finite | None
    """Error of the agreement, by the jackknife over lanes; None where too few of them are known."""
    nearest: Place | None
    """The slot whose reward pays most like this one, among those that train and those that trained."""
    likeness: Finite | None
    """Absolute rank correlation of what the two pay, over recorded states; None where either is constant."""
    reason: str = ""
    """Why it does not train, for people."""


@dataclass(frozen=True, slots=True)
class Generation:
    """A finished generation: an entry for each slot, in order."""

    index: int
    entries: tuple[Scored, ...]
    remarks: tuple[Remark, ...] = ()
    """What a person said before the next generation was asked for."""
    limits: Limits = field(default_factory=dict[str, float], hash=False)
    """As in `History`."""

    @property
    def trained(self) -> int:
        """The number of entries that trained."""
        return sum(entry.trained for entry in self.entries)

    @property
    def scores(self) -> list[float]:
        """Scores of the entries from which `best` is chosen."""
        return [entry.score for entry in self._scored if entry.score is not None]

    @property
    def best(self) -> Scored | None:
        """The entry of highest score that keeps the limits, the earlier of equals; an undefined score never wins."""
        return max(self._scored, key=lambda entry: entry.score or 0.0, default=None)

    @property
    def _scored(self) -> list[Scored]:
        """The entries with a score that keep the limits, however their training ended."""
        return [entry for entry in self.entries if entry.score is not None and not entry.breaks(self.limits)]


@dataclass(frozen=True, slots=True)
class History:
    """Everything a search strategy may look at; `strategies.Ranking` says which entry is ahead."""

    generations: tuple[Generation, ...] = ()
    judge: Literal["fitness", "votes"] = "fitness"
    limits: Limits = field(default_factory=dict[str, float], hash=False)
    """A reward whose policy breaks one of these cannot win."""

    @property
    def entries(self) -> tuple[Scored, ...]:
        """The slots of all finished generations, in their order."""
        return tuple(entry for generation in self.generations for entry in generation.entries)

    def entry(self, place: Place | None) -> Scored | None:
        """The slot at a place; None where there is none."""
        return next((entry for entry in self.entries if entry.sample.place == place), None)

    def grown(self, entries: Sequence[Scored]) -> History:
        """The history with one more generation."""
        generation = Generation(len(self.generations), tuple(entries), limits=self.limits)
        return replace(self, generations=(*self.generations, generation))

    def rescored(self, scores: Mapping[str, Evaluation]) -> History:
        """The history with the newest scores of its policies, by lane id: leading ones may have been played again."""
        generations = [
            replace(
                generation,
                entries=tuple(
                    replace(entry, played=scores.get(entry.result.lane, entry.played)) if entry.result else entry
                    for entry in generation.entries
                ),
            )
            for generation in self.generations
        ]
        return replace(self, generations=tuple(generations))

    @property
    def lanes(self) -> tuple[str, ...]:
        """Lane ids of its candidates, as far as these have a result."""
        return tuple(entry.result.lane for entry in self.entries if entry.result is not None)

    def spent(self) -> Iterator[tuple[Scored, int]]:
        """The slots with a result, in order, each with the environment steps that it added.

        0 where it shares a training: with an equal program of the search, or an equal graph of its generation.
        """
        lanes = set[str]()
        for generation in self.generations:
            graphs = set[str]()
            for entry in generation.entries:
                if entry.result is None:
                    continue
                graph = entry.sample.verdict.graph
                form = entry.result.lane if graph is None else str(graph)
                shared = entry.result.lane in lanes or form in graphs
                lanes.add(entry.result.lane)
                graphs.add(form)
                yield entry, 0 if shared else entry.result.env_steps

    def heard(self, remarks: Sequence[Remark]) -> History:
        """The history with what a person said of the last generation."""
        last = replace(self.generations[-1], remarks=tuple(remarks))
        return replace(self, generations=(*self.generations[:-1], last))


@dataclass(frozen=True, slots=True, kw_only=True)
class Opinion:
    """What a person thinks of the search so far, as a prompt shows it."""

    words: tuple[str, ...] = ()
    """Everything the person said, the newest last."""
    chosen: bool = False
    """Whether the parent is the person's choice."""
    won: int = 0
    lost: int = 0
    """Comparisons with other policies that the parent's policy won and lost."""
    vetoed: tuple[Scored, ...] = ()
    """Rejected programs, the newest veto last."""
    by_votes: bool = False
    """Whether comparisons, and not scores, decide which reward is the best."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PromptPlan:
    """One prompt to send: `count` samples that see `turns` (oldest first) as the conversation so far."""

    count: int
    turns: tuple[Scored, ...] = ()
    """Each becomes the model's own earlier answer followed by its feedback; empty for the first generation."""
    failures: tuple[Scored, ...] = ()
    """Slots of a generation in which nothing trained, refused or not: the model is told why."""
    opinion: Opinion = Opinion()
    informed: bool = False
    """Whether the prompt says what the score is, how high each turn scores, and which is the best."""
    best: Scored | None = None
    """The best reward so far; the favourite of a person may be another one."""
    siblings: tuple[Scored, ...] = ()
    """The other rewards of the parent's generation that nobody rejected."""
    limits: Limits = field(default_factory=dict[str, float], hash=False)
    """The most that policies may cost: the prompt says which shown rewards break one."""
    crossover: bool = False
    """Whether the last two turns are both parents: the model is then asked to combine what is good in them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Glance:
    """How far a run has come, in numbers that are cheap to read."""

    generations: int
    """Number of finished generations."""
    fitness: float | None
    """The best F in these, of rewards that keep the limits: F when played, or in training where nothing was played."""
    evaluations: int
    """Number of held-out scores, which a run takes last."""
    ended: bool
    """Whether the run is over, except for reports."""
    trainings: int
    """Number of finished trainings."""
    held_out: float | None
    """Held-out F of the best reward in its final trainings, mean over seeds; of the best given reward in a run without
    a search. None before these are scored."""
    human: float | None
    """The same for the human reward, where the run trained it."""
    usage: Usage
    word: Word = ""
    """What a finished search decided; empty for a run of an older version."""
