"""Lanes, the results, scores and costs of their training, and the interface of a trainer."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Literal, NamedTuple, Protocol, TypeVar

from .bounds import Count, Finite, Name, Share
from .dynamics import NOMINAL, Dynamics, Ranges
from .rewards import RewardGraph

OWN_REWARDS: tuple[Literal["human", "sparse"], ...] = ("human", "sparse")
"""Names of the rewards that come with a task."""
RewardProgram = RewardGraph | Literal["human", "sparse"]

Peak = Literal["fitness", "reward", "last"]
"""Which of a lane's policies: where F was highest in training, where its own reward was, or the one at the end."""
PEAKS: tuple[Peak, ...] = ("reward", "last", "fitness")
"""All of them, in the order in which they are played; of equal ones the first counts."""

Observe = Literal["all", "measurable"]

Bonus = Literal["none", "original", "progress"]


COMPONENT = "component/"
"""Prefix of the name of a component's curve."""
Curve = TypeVar("Curve")


def of_components(curves: Mapping[str, Curve]) -> dict[str, Curve]:
    """The curves of a reward's components, by the names that it gives them."""
    return {name.removeprefix(COMPONENT): curve for name, curve in curves.items() if name.startswith(COMPONENT)}


class PolicyId(NamedTuple):
    """A policy of a run: a lane, and which of its policies."""

    lane: str
    peak: Peak


Role = Literal[
    "candidate",  # a slot of a generation
    "baseline",  # the human or the sparse reward beside the first generation
    "final",  # a fresh seed, at the end of a search
    "given",  # a reward that a person gave, without a search
    "tuned",  # fits the numbers of a reward
    "polish",  # trains the best policy further
    "robust",  # trains it further, or anew, in worlds that differ
]
"""Why a lane is trained."""


@dataclass(frozen=True, slots=True)
class Start:
    """The policy that a lane goes on from, where it does not begin anew."""

    policy: PolicyId
    """A policy of an earlier lane of the run."""
    fresh: Share
    """Share of fresh weights in the mixture with that policy's weights."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardening:
    """How a run trains its robust policies: all alike, or they could not be compared."""

    policy: PolicyId
    """The policy that they are compared with, and go on from."""
    anew: bool
    """Whether they begin from scratch instead."""
    steps: Count
    """Environment steps of each; 0 for the task's own number."""


@dataclass(frozen=True, slots=True)
class Lane:
    """One training of a run: a reward and a seed."""

    reward: str
    """A candidate's id, `human` or `sparse`, or what a given reward is called."""
    seed: Count
    role: Role
    start: Start | None = None
    ranges: str = ""
    """Name of the ranges that its worlds are drawn from; empty for those of the run."""

    @property
    def id(self) -> str:
        return lane_id(self.reward, self.seed) + (f"-{self.ranges}" if self.ranges else "")


def lane_id(reward: str, seed: int) -> str:
    """The id of a lane within its run."""
    return f"{reward}-s{seed}"


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneSpec:
    """One lane: a reward program and a seed."""

    id: str
    """Unique within a run, e.g. `<candidate>-s<seed>` or `human-s0`."""
    program: RewardProgram
    seed: int = 0
    start: bytes | None = field(default=None, repr=False)
    """Policy that training goes on from (safetensors, see `training.policy`); None begins anew."""
    fresh: Share = 0.0
    """Share of the seed's fresh weights that `start` is mixed with."""
    rescaled: bool = False
    """Whether `start` was trained under another reward: the scale of the returns is then learnt anew."""
    randomise: Ranges | None = None
    """Ranges that the lane's worlds are drawn from, instead of the budget's."""
    paused: bytes | None = field(default=None, repr=False)
    """State in which this same training paused (`TrainingResult.paused`), to go on from; None begins anew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainBudget:
    """What each lane may spend (0 is the task's default), and the rules of its training."""

    env_steps: int = 0
    worlds: int = 0
    until: float = 1.0
    """Share of a lane's steps after which it pauses; 1 is the end."""
    bonus: Bonus = "none"
    """What a training adds to generated rewards: the task's `success_bonus`, as in the original, or pay for rare values
    of the components that tell progress (`training.rewards`)."""
    randomise: Ranges | None = None
    """Ranges that the worlds of training are drawn from; None for the task's own world alone."""
    observe: Observe = "all"
    """What policies see: the whole observation, or what a robot's sensors tell. The critic sees all of it."""


class TrainingState(StrEnum):
    """How the training of a lane ended."""

    FINISHED = "finished"
    PAUSED = "paused"  # at `TrainBudget.until`; it may go on
    CUT = "cut"  # it paused, and others of its generation went on
    DIVERGED = "diverged"  # non-finite or absurd reward, policy or physics: the lane was masked
    FAILED = "failed"  # its training killed the worker more often than allowed


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """A policy at one epoch. `policy` is a safetensors file (see `training.policy`)."""

    epoch: Count
    value: Finite
    """The quantity that peaked: fitness or the mean own reward per step."""
    policy: bytes = field(default=b"", repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingResult:
    """What one lane's training left."""

    lane: str
    state: TrainingState
    fitness: Finite | None
    """Maximum over epochs of the task's F; None when F was never defined."""
    curves: Mapping[Name, tuple[Finite | None, ...]]
    """Per-epoch means over the lane's worlds: `fitness`, `episode_length` [steps], `reward` (own, per step),
    `human_reward` (per step), and `component/<name>` for each component. Also of each epoch, from the update that ends
    it: `ppo/surrogate_loss`, `ppo/value_loss`, `ppo/kl`, `ppo/entropy` [nats] and `ppo/learning_rate`; older trainings
    lack these, and no model is shown them. None where undefined in that epoch.

    Over the last tenth of the epochs, a single number each: `component_early/<name>` in the first quarter of the
    longest possible episode, `component_late/<name>` in the rest. Older trainings lack them."""
    env_steps: Count
    seconds: Finite
    steps_before: Count = 0
    """Environment steps before the curves begin: those of the earlier stages of a curriculum."""
    clock: tuple[Finite, ...] = field(default=(), compare=False, repr=False)
    """Training time [s] at each epoch of the curves; empty where an older version kept none."""
    correlation: Finite | None = None
    """Pearson correlation of own and human reward over the transitions of training; None when either is constant, and
    for a lane that diverged or failed."""
    best_fitness: Checkpoint | None = None
    best_reward: Checkpoint | None = None
    last: bytes | None = field(default=None, repr=False)
    """Policy at the end of training, from which the next stage of a curriculum goes on; None for a lane that
    diverged or failed, and where the store left it in its file."""
    paused: bytes | None = field(default=None, compare=False, repr=False)
    """The whole state from which a PAUSED lane goes on; None for other lanes, and where the store holds it."""
    message: str = ""
    """Why the lane ended early, for people; empty otherwise."""

    @property
    def over_epochs(self) -> dict[Name, tuple[Finite | None, ...]]:
        """The curves, without those entries that are a single number."""
        single = ("component_early/", "component_late/")
        return {name: curve for name, curve in self.curves.items() if not name.startswith(single)}

    @property
    def policies(self) -> dict[str, bytes]:
        """Its policies, by the names of their fields."""
        peaks = {"best_fitness": self.best_fitness, "best_reward": self.best_reward}
        found = {name: peak.policy for name, peak in peaks.items() if peak is not None}
        return found | ({"last": self.last} if self.last is not None else {})

    @property
    def blobs(self) -> dict[str, bytes]:
        """Its policies and the state that it goes on from, by the names of their fields."""
        return self.policies | ({"paused": self.paused} if self.paused is not None else {})

    def holding(self, blobs: Mapping[str, bytes]) -> TrainingResult:
        """A copy with only these of its `blobs`; a peak whose policy is not among them has an empty one."""
        peaks = {
            name: replace(peak, policy=blobs.get(name, b""))
            for name, peak in (("best_fitness", self.best_fitness), ("best_reward", self.best_reward))
            if peak is not None
        }
        return replace(self, **peaks, last=blobs.get("last"), paused=blobs.get("paused"))


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeShare:
    """What one machine of a cluster trains."""

    lanes: int
    env_steps_per_second: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingProgress:
    """Sent by a trainer between results, about once a second."""

    epoch: int
    epochs: int
    env_steps_per_second: float
    fitness: Mapping[str, Finite | None]
    """Best F so far per lane id."""
    resumed: int = 0
    """Of `epoch`, those that a stopped run had done before: they say nothing about the pace."""
    latest: Mapping[str, Mapping[Name, Finite | None]] = field(default_factory=dict[str, Mapping[str, "Finite | None"]])
    """Newest value of `fitness`, `reward` and each `component/<name>` per lane id."""
    nodes: Mapping[str, NodeShare] = field(default_factory=dict[str, NodeShare])
    """What each machine of a cluster trains, by name; empty on one machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Episodes:
    """Some episodes of one policy, with a part of their states: enough to tell what other rewards would have paid."""

    fitness: tuple[Finite | None, ...]
    """F of each; None where it is undefined."""
    steps: tuple[Count, ...]
    """Steps of each, before states were left out."""
    owners: tuple[Count, ...]
    """For each state that is left, the index of its episode."""
    states: bytes = field(default=b"", repr=False)
    """The states that are left, in a form that only trainers read."""


class Cost(NamedTuple):
    """A measured quantity of a robot at work; less is better."""

    unit: str
    meaning: str


COSTS: Mapping[str, Cost] = {
    "torque": Cost("N m", "largest torque of a driven joint, mean over steps"),
    "torque_peak": Cost("N m", "largest torque of a driven joint in an episode, mean over episodes"),
    "torque_rate": Cost("N m/s", "fastest change of a driven joint's torque, mean over steps"),
    "joint_limits": Cost("share", "steps in which a driven joint is at an end of its range"),
    "speed": Cost("rad/s", "fastest driven joint, mean over steps"),
    "power": Cost("W", "torque times rate of all driven joints, whichever its sign, mean over steps"),
    "contact_force": Cost("N", "largest net force of all contacts on the robot in an episode, mean over episodes"),
    "falls": Cost("share", "episodes that a failure ends early"),
}
"""By name. Joints that slide are measured in N, N/s and m/s."""

Limits = Mapping[str, float]
"""The most of each named cost that a policy may have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What one policy scores when it is played in fresh episodes."""

    lane: str
    fitness: Finite | None
    episode_length: Finite
    episodes: int
    """Episodes that were played to their end."""
    lost: int = 0
    """Further episodes, in which the physics broke down. An F that measures whole episodes leaves them out. Also 0
    where an older version did not count them."""
    error: Finite | None = None
    """Standard error of `fitness` over episodes; None where it was not measured."""
    noisy: bool = False
    """Whether actions had the noise of training. Without it, all episodes of such a task would be identical."""
    concentration: Finite | None = None
    """Share of the positive contributions to F that comes from the highest twentieth of them; None without any."""
    peak: Peak | None = None
    """Which of the lane's policies played; None for an untrained one, and where an older version did not say."""
    costs: Mapping[Name, Finite] = field(default_factory=dict[str, float], hash=False)
    """The policy's costs, by the names in `COSTS`, as far as the task has them."""
    recorded: Episodes | None = field(default=None, compare=False, repr=False)
    """Some of its episodes, if recording was asked for; None in a score from a store, which keeps episodes apart."""

    def broken(self, limits: Limits) -> tuple[str, ...]:
        """The limits that the policy breaks, by name; what was not measured breaks none."""
        return tuple(name for name, most in limits.items() if self.costs.get(name, -math.inf) > most)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tryout:
    """One more held-out score to take of a lane: of another policy, or in another world."""

    lane: str
    name: str
    peak: Peak
    """Which of the lane's policies plays."""
    dynamics: Dynamics = NOMINAL
    untrained: int | None = None
    """The seed with whose initial weights the policy plays, as before any training; None with its own weights."""


@dataclass(frozen=True, slots=True)
class Standing:
    """How a lane stood when it paused."""

    played: Evaluation
    """Score of its policy at that moment."""
    went_on: bool
    """Whether it trained on; if not, others of its generation did."""


TrainingEvent = TrainingProgress | TrainingResult
"""What a trainer reports of a lane."""


class Trainer(Protocol):
    """Trains lanes and scores policies, like `executors.local.LocalExecutor`."""

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[TrainingEvent]:
        """Train every lane; exactly one result per lane, in any order, progress in between.

        With `budget.until`, the result of a lane that reaches that share is PAUSED. Lanes that go on from there are
        given with that state, all at the same epoch, and need not be grouped as before.
        """
        ...

    def evaluate(
        self,
        env: str,
        policies: Mapping[str, bytes],
        *,
        seed: int,
        episodes: int = 0,
        dynamics: Mapping[str, Dynamics] | None = None,
        record: Collection[str] = (),
        untrained: Mapping[str, int] | None = None,
    ) -> Iterator[Evaluation]:
        """Score of each policy (lane id -> safetensors bytes), all on the same start states, which no training saw.

        Args:
            seed: seed of the start states.
            episodes: episodes of each policy; 0 for as many as a final score needs.
            dynamics: by lane id, the worlds of lanes that play in another world than the task's.
            record: ids of the lanes whose score comes with some of their episodes; only `screen=` needs this.
            untrained: by lane id, the seeds of lanes that play with a seed's initial weights instead of their policy's.
        """
        ...

    def rewards(
        self, env: str, programs: Mapping[str, RewardGraph], episodes: Sequence[Episodes]
    ) -> Mapping[str, Sequence[float]]:
        """What each program pays in each recorded state, by the program's name; states are in the order of `episodes`.

        A program that cannot be computed there is left out. Only `screen=` needs this.
        """
        ...
