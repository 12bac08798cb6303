"""The nouns of a run: frozen data, no behaviour that touches a file, a process or a tensor.

World axis N, lane axis L and worlds per lane n are used throughout; N = L * n.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Literal, NamedTuple, Protocol

# --- state: the only names a reward may read -------------------------------------------------------------------------

StateKind = Literal["world", "constant", "float", "int", "num_envs"]
StateUse = Literal["raw", "zero_centred", "directional", "point"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StateVar:
    """One variable a reward may name as an argument."""

    name: str
    meaning: str
    """What it is, with unit and frame, as the language model reads it."""
    shape: tuple[int, ...] = ()
    """Shape without the world axis: () for a per-world scalar (N,), (3,) for (N, 3)."""
    kind: StateKind = "world"
    """`world`: float32 tensor (N, *shape); `constant`: tensor `shape`, the same for all worlds, float32 (int64 where it
    holds indices); `float`, `int`: a Python number; `num_envs`: the number of worlds, a Python int."""
    use: StateUse = "raw"
    """How the typed grammar may use it. `raw`: not offered (original variables of mixed content). `zero_centred`: good
    when near zero, never a term by its sign. `directional`: more is meaningful (a speed, a projection). `point`: a
    position, used in distances to other points of equal shape."""


@dataclass(frozen=True, slots=True)
class StateSpec:
    """The ordered table of a task's state variables."""

    variables: tuple[StateVar, ...]

    def __post_init__(self) -> None:
        names = self.names
        if len(set(names)) != len(names):
            raise ValueError(f"state variable named twice in {names}")

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(variable.name for variable in self.variables)

    def __getitem__(self, name: str) -> StateVar:
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        return name in self.names


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskContext:
    """What a language model may know of a task."""

    env: str
    description: str
    """The intent, one sentence."""
    state: StateSpec
    source: str
    """The task's file without fitness, rewards, success thresholds and training defaults."""


# --- reward programs -------------------------------------------------------------------------------------------------

CandidateId = str

Arg = None | bool | int | float | str | Mapping[str, "Arg"] | tuple["Arg", ...]
"""A graph argument: JSON, where `{"ref": i}` is the value of node i and `{"n": k}` is k times the number of worlds."""


@dataclass(frozen=True, slots=True)
class Node:
    """One tensor operation: an allow-listed ATen overload (`add.Tensor`), or `input` with a variable's name as its only
    argument."""

    op: str
    args: tuple[Arg, ...] = ()
    kwargs: Mapping[str, Arg] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class RewardGraph:
    """A reward program as data: a straight line of tensor operations, valid for any number of worlds."""

    nodes: tuple[Node, ...]
    reward: int
    """Index of the node whose value is the total reward, (N,)."""
    components: tuple[tuple[str, int], ...]
    """Component name and node index, in the program's order; each value is (N,) or () float."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One generated reward program. Equal programs are one candidate: they share a verdict and a training."""

    id: CandidateId
    source: str

    @staticmethod
    def of(source: str) -> Candidate:
        return Candidate(id=hashlib.sha256(source.encode(errors="surrogatepass")).hexdigest()[:12], source=source)


class VerdictCode(StrEnum):
    """Outcome of checking a program, by the layer that decided."""

    ACCEPTED = "accepted"
    NO_PROGRAM = "no_program"  # the reply held no function
    REFUSED = "refused"  # gate: read as text, never run
    CONTRACT = "contract"  # probe: ran in the confined child and broke a rule
    TIMEOUT = "timeout"
    CRASHED = "crashed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One reason for a refusal, addressed to the author of the program."""

    rule: str
    """Short kebab-case name of the broken rule, as listed in `docs/concepts/sandbox.md`."""
    message: str
    fix: str = ""
    """What to write instead."""
    line: int | None = None

    def sentence(self) -> str:
        where = f"line {self.line}: " if self.line is not None else ""
        fix = f"; {self.fix}" if self.fix else ""
        return f"{where}{self.message} [{self.rule}]{fix}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What gate and probe found. `graph` is set exactly when the code is ACCEPTED."""

    candidate: CandidateId
    code: VerdictCode
    findings: tuple[Finding, ...] = ()
    graph: RewardGraph | None = None
    seconds: float = 0.0

    @property
    def accepted(self) -> bool:
        return self.code is VerdictCode.ACCEPTED


# --- language models -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Message:
    role: Literal["system", "user", "assistant"]
    content: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Prompt:
    """What a model is asked. `grammar` (GBNF) and `prefill` are set only for models whose style is `grammar`: the reply
    then is `prefill` plus text that the grammar derives."""

    messages: tuple[Message, ...]
    grammar: str | None = None
    prefill: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float = 0.0

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            prompt_tokens=self.prompt_tokens + other.prompt_tokens,
            completion_tokens=self.completion_tokens + other.completion_tokens,
            cost_usd=self.cost_usd + other.cost_usd,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """One completed sample, text as received (prefill included)."""

    text: str
    model: str
    usage: Usage = Usage()
    seconds: float = 0.0


GIVEN = "given"
"""`Reply.model` of a reward that the run began with: nobody was asked for it."""

# --- training --------------------------------------------------------------------------------------------------------

RewardProgram = RewardGraph | Literal["human", "sparse"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainJob:
    """One lane: a reward program and a seed."""

    id: str
    """Unique within a run, e.g. `<candidate>-s<seed>` or `human-s0`."""
    program: RewardProgram
    seed: int = 0
    start: bytes | None = field(default=None, repr=False)
    """Policy that training goes on from (safetensors, see `training.policy`); None begins anew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainBudget:
    """What each lane may spend, zero meaning the task's default, and under which rules."""

    env_steps: int = 0
    worlds: int = 0
    bonus: bool = False
    """Add the task's `success_bonus` to generated rewards, as the original does."""


class TrainingState(StrEnum):
    FINISHED = "finished"
    DIVERGED = "diverged"  # non-finite or absurd reward, policy or physics: the lane was masked
    FAILED = "failed"  # the worker died with it, more often than it may


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """A policy at one epoch. `policy` is a safetensors file (see `training.policy`)."""

    epoch: int
    value: float
    """The quantity that peaked: fitness or the mean own reward per step."""
    policy: bytes = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingResult:
    """What one lane's training left."""

    job: str
    state: TrainingState
    fitness: float | None
    """Maximum over epochs of the task's F; None when F was never defined."""
    curves: Mapping[str, tuple[float | None, ...]]
    """Per-epoch means over the lane's worlds: `fitness`, `episode_length` [steps], `reward` (own, per step),
    `human_reward` (per step), and `component/<name>` for each component. None where undefined in that epoch."""
    env_steps: int
    seconds: float
    correlation: float | None = None
    """Pearson correlation of own and human reward over the transitions of training; None when either is constant."""
    best_fitness: Checkpoint | None = None
    best_reward: Checkpoint | None = None
    last: bytes | None = field(default=None, repr=False)
    """Policy at the end of training, which a curriculum goes on from; None for a lane that ended early."""
    message: str = ""
    """Why the lane ended early, for people; empty otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingProgress:
    """Sent by a trainer between results, about once a second."""

    epoch: int
    epochs: int
    env_steps_per_second: float
    fitness: Mapping[str, float | None]
    """Best F so far per job id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dynamics:
    """Factors on what a task's model says of the world; 1 is the task as it is."""

    mass: float = 1.0
    """On every body's mass and inertia."""
    friction: float = 1.0
    """On every contact's friction."""


NOMINAL = Dynamics()
"""The task's own world."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Held-out score of one policy: deterministic actions, fresh episodes."""

    job: str
    fitness: float | None
    episode_length: float
    episodes: int
    error: float | None = None
    """Standard error of `fitness` over episodes; None where nobody measured it."""
    concentration: float | None = None
    """Share of the positive contributions to F that the highest twentieth of them makes; None without any."""


class Trainer(Protocol):
    """Trains lanes and scores policies, like `training.executor.PopulationTrainer`."""

    def train(
        self, env: str, jobs: Sequence[TrainJob], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        """Train every job; exactly one result per job, in any order, progress in between."""
        ...

    def evaluate(
        self, env: str, policies: Mapping[str, bytes], *, seed: int, dynamics: Mapping[str, Dynamics] | None = None
    ) -> Iterator[Evaluation]:
        """Held-out score of each policy (job id -> safetensors bytes), all on the same start states.

        `dynamics` names the jobs that play in another world than the task's.
        """
        ...


# --- search ----------------------------------------------------------------------------------------------------------


class Place(NamedTuple):
    """A slot of a generation: what people call a candidate by, as in `g0s3`."""

    generation: int
    slot: int

    def __str__(self) -> str:
        return f"g{self.generation}s{self.slot}"


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
    """A slot with the result of its training (None: never trained) and the feedback text made of both."""

    sample: Sample
    result: TrainingResult | None
    feedback: str

    @property
    def fitness(self) -> float | None:
        return self.result.fitness if self.result is not None else None

    @property
    def trained(self) -> bool:
        """Whether its training came to the end, with or without a defined F."""
        return self.result is not None and self.result.state is TrainingState.FINISHED


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
    candidate: Place | None = None
    """The favourite, the vetoed one, or the one preferred in a vote."""
    over: Place | None = None
    """The other one of a vote."""


@dataclass(frozen=True, slots=True)
class Generation:
    index: int
    entries: tuple[Scored, ...]
    remarks: tuple[Remark, ...] = ()
    """What a person said before the next generation was asked for."""

    @property
    def best(self) -> Scored | None:
        """The entry of highest F; undefined F never wins, ties go to the earlier slot."""
        scored = [entry for entry in self.entries if entry.fitness is not None]
        return max(scored, key=lambda entry: entry.fitness or 0.0, default=None)


@dataclass(frozen=True, slots=True)
class History:
    """Everything a search strategy may look at; `search.Ranking` says who is ahead."""

    generations: tuple[Generation, ...] = ()
    judge: Literal["fitness", "votes"] = "fitness"

    def grown(self, entries: Sequence[Scored]) -> History:
        """With one more generation."""
        generation = Generation(len(self.generations), tuple(entries))
        return replace(self, generations=(*self.generations, generation))

    def heard(self, remarks: Sequence[Remark]) -> History:
        """With what a person said of the last generation."""
        last = replace(self.generations[-1], remarks=tuple(remarks))
        return replace(self, generations=(*self.generations[:-1], last))


@dataclass(frozen=True, slots=True, kw_only=True)
class Opinion:
    """What a person thinks of the search so far, as a prompt shows it."""

    words: tuple[str, ...] = ()
    """All that was said, the newest last."""
    chosen: bool = False
    """The parent is the person's choice."""
    won: int = 0
    lost: int = 0
    """Comparisons of the parent's policy with others."""
    vetoed: tuple[Scored, ...] = ()
    """Rejected programs, the newest veto last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PromptPlan:
    """One prompt to send: `count` samples that see `turns` (oldest first) as the conversation so far."""

    count: int
    turns: tuple[Scored, ...] = ()
    """Each becomes the model's own earlier answer followed by its feedback; empty for the first generation."""
    failures: tuple[Scored, ...] = ()
    """Refused programs of a generation in which nothing trained: the model is told why."""
    opinion: Opinion = Opinion()


@dataclass(frozen=True, slots=True, kw_only=True)
class Glance:
    """How far a run has come, in numbers that cost nothing to read."""

    generations: int
    """Finished ones."""
    fitness: float | None
    """The best F among them."""
    evaluations: int
    """Held-out scores: they come last."""
    usage: Usage
