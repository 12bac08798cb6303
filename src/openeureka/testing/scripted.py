"""Fakes of a search's parts: a model that reads from a script, a checker and a trainer that are pure functions of the
program, and a desk at which nobody sits.

A whole search with them takes milliseconds and needs no torch, no physics and no weights.
"""

from __future__ import annotations

import dataclasses
import re
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ..codec import decode, encode
from ..types import (
    Candidate,
    Checkpoint,
    Dynamics,
    Episodes,
    Evaluation,
    Finding,
    Generation,
    LaneSpec,
    Node,
    Prompt,
    Reply,
    RewardGraph,
    StateSpec,
    Style,
    TaskContext,
    TrainBudget,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
    VerdictCode,
)

TOY = TaskContext(env="toy", description="Do the thing.", state=StateSpec(()), source="")
"""A task without state or source."""

_USAGE = Usage(prompt_tokens=100, completion_tokens=10, cost_usd=0.01)
_WORTH = re.compile(r"return (-?\d+(?:\.\d+)?)")


def program(worth: float) -> str:
    """A program whose training reaches exactly this F with seed 0."""
    return f"def compute_reward(x):\n    return {worth}\n"


def reply(worth: float) -> str:
    """A model's reply with that program."""
    return f"Here is the reward.\n```python\n{program(worth)}```\n"


@dataclass
class ScriptedModel:
    """Gives the texts of a script one after the other, and keeps what it was asked."""

    script: Sequence[str]
    name: str = "scripted"
    style: Style = "free"
    usage: Usage = _USAGE
    prompts: list[Prompt] = field(default_factory=list)
    seeds: list[int] = field(default_factory=list)
    said: int = 0
    """Replies given so far; set it to begin in the middle of the script."""
    closed: int = 0

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        self.prompts.append(prompt)
        self.seeds.append(seed)
        for _ in range(n):
            text = self.script[self.said]
            self.said += 1
            yield Reply(text=text, model=self.name, usage=self.usage)

    def close(self) -> None:
        self.closed += 1


@dataclass
class ToyChecker:
    """Accepts programs that return a number: their graph is that number."""

    checked: list[str] = field(default_factory=list)

    def check(self, candidate: Candidate) -> Verdict:
        self.checked.append(candidate.source)
        found = _WORTH.search(candidate.source)
        if found is None:
            finding = Finding(rule="no-number", message="nothing is returned", fix="return a number", line=1)
            return Verdict(candidate=candidate.id, code=VerdictCode.REFUSED, findings=(finding,))
        graph = RewardGraph(nodes=(Node("full", (float(found[1]),)),), reward=0, components=(("worth", 0),))
        return Verdict(candidate=candidate.id, code=VerdictCode.ACCEPTED, graph=graph)


@dataclass
class ToyTrainer:
    """F in training is the number that a program returns (human reward: 10, sparse: 5) plus seed / 100. Played, it is
    one less, and -1 for an untrained policy. A lane that starts from a policy mixes the F of that policy with its own,
    as `fresh` says."""

    trained: list[str] = field(default_factory=list)
    error: float = 0.0
    """Standard error of every played F; rewards closer than two standard errors of their difference are level."""

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[TrainingEvent]:
        yield TrainingProgress(epoch=1, epochs=2, env_steps_per_second=1.0, fitness={lane.id: None for lane in lanes})
        for lane in lanes:
            self.trained.append(lane.id)
            yield self._paused(lane, budget.until) if budget.until < 1.0 else self.result(lane)

    def _paused(self, lane: LaneSpec, until: float) -> TrainingResult:
        """The result of a lane that pauses, with the F of the whole training. A lane that was there already fails."""
        begun = float(lane.paused or 0.0)
        if begun >= until:
            raise ValueError(f"{lane.id} was there already")
        whole = self.result(lane)
        return dataclasses.replace(whole, state=TrainingState.PAUSED, paused=str(until).encode())

    def result(self, lane: LaneSpec) -> TrainingResult:
        """The result of a lane's whole training."""
        worth = _worth(lane)
        peak = Checkpoint(epoch=1, value=worth, policy=str(worth).encode())
        own = (0.0, worth / 2, worth)
        return TrainingResult(
            lane=lane.id,
            state=TrainingState.FINISHED,
            fitness=worth,
            curves={
                "fitness": (None, worth / 2, worth),
                "episode_length": (1.0, 2.0, 3.0),
                "reward": own,
                "human_reward": (0.0, 1.0, 2.0),
                "component/worth": own,
            },
            env_steps=3,
            seconds=0.0,
            correlation=1.0 if lane.program == "human" else 0.5,
            best_fitness=peak,
            best_reward=peak,
            last=peak.policy,
        )

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
        for lane, policy in policies.items():
            yield Evaluation(
                lane=lane,
                fitness=(0.0 if lane in (untrained or ()) else float(policy)) - 1,
                episode_length=3.0,
                episodes=episodes or 4,
                error=self.error,
                recorded=_episodes(float(policy)) if lane in record else None,
            )

    def rewards(
        self, env: str, programs: Mapping[str, RewardGraph], episodes: Sequence[Episodes]
    ) -> Mapping[str, Sequence[float]]:
        """A program pays more, the nearer a state is to the number that it returns."""
        states = [state for one in episodes for state in decode(list[float], one.states)]
        return {name: [-abs(state - _number(program)) for state in states] for name, program in programs.items()}


class ToyDesk:
    """A desk at which nobody sits: people say what they have to say elsewhere, for example on the page."""

    def invite(self, generation: Generation) -> None: ...

    def listen(self, seconds: float) -> None:
        time.sleep(seconds)


def _episodes(worth: float) -> Episodes:
    """Two episodes of three steps; every state is the F of its episode."""
    fitness = (worth - 1.0, worth - 0.9)
    states = [f for f in fitness for _ in range(3)]
    return Episodes(fitness=fitness, steps=(3, 3), owners=(0, 0, 0, 1, 1, 1), states=encode(states).encode())


def _number(program: RewardGraph) -> float:
    (number,) = program.nodes[0].args
    assert isinstance(number, float)
    return number


def _worth(lane: LaneSpec) -> float:
    if isinstance(lane.program, RewardGraph):
        base = _number(lane.program)
    else:
        base = {"human": 10.0, "sparse": 5.0}[lane.program]
    worth = base + lane.seed / 100
    return worth if lane.start is None else (1.0 - lane.fresh) * float(lane.start) + lane.fresh * worth
