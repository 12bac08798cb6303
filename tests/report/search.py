"""A small made-up search, whose numbers the tests of the report expect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from openeureka.config import RunConfig
from openeureka.report.candidates import CandidateView, GenerationView
from openeureka.report.view import RunView
from openeureka.types import (
    Candidate,
    Evaluation,
    Finding,
    Generation,
    History,
    Place,
    Sample,
    Scored,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
    VerdictCode,
)


def trained(generation: int, slot: int, fitness: float | None, source: str = "", attempts: int = 1) -> Scored:
    """A slot whose program was accepted and trained; with a fitness of None, the training diverged."""
    candidate = Candidate.of(source or f"# reward {generation}.{slot}")
    sample = Sample(
        generation=generation,
        slot=slot,
        candidate=candidate,
        verdict=Verdict(candidate=candidate.id, code=VerdictCode.ACCEPTED),
        attempts=attempts,
    )
    return Scored(sample=sample, result=result(candidate.id, fitness), feedback="")


def refused(generation: int, slot: int, message: str) -> Scored:
    """A slot whose program was refused, three replies spent."""
    finding = Finding(rule="unknown-input", message=message, line=2)
    verdict = Verdict(candidate="c", code=VerdictCode.REFUSED, findings=(finding,))
    sample = Sample(generation=generation, slot=slot, candidate=None, verdict=verdict, attempts=3)
    return Scored(sample=sample, result=None, feedback="")


def result(lane: str, fitness: float | None) -> TrainingResult:
    """A training of two epochs; with a fitness of None, it diverged."""
    return TrainingResult(
        lane=lane,
        state=TrainingState.DIVERGED if fitness is None else TrainingState.FINISHED,
        fitness=fitness,
        curves={"fitness": (None, fitness), "component/$upright": (0.25, 0.5)},
        env_steps=100,
        seconds=1.0,
    )


HISTORY = History(
    (
        Generation(0, (trained(0, 0, 10.0), trained(0, 1, 30.0, attempts=2), refused(0, 2, "no `spede` in the state"))),
        Generation(1, (trained(1, 0, 20.0), trained(1, 1, None))),
        Generation(2, (trained(2, 0, 50.0, source="def compute_reward(x):\n    return x, {}"),)),
    )
)
BEST = "def compute_reward(x):\n    return x, {}"
BASELINES = [result("human-s0", 60.0), result("sparse-s0", 20.0)]


def run(history: History, results: Sequence[TrainingResult] = (), evaluations: Sequence[Evaluation] = ()) -> RunView:
    """A run of three generations and two final seeds."""
    return RunView(
        config=RunConfig(env="cartpole", iteration=3, seeds=2),
        history=history,
        generations=tuple(
            GenerationView(index=generation.index, candidates=tuple(map(view, generation.entries)))
            for generation in history.generations
        ),
        results={r.lane: r for r in results},
        evaluations={e.lane: e for e in evaluations},
        tryouts={},
        usage=Usage(prompt_tokens=1200, completion_tokens=340, cost_usd=0.0125),
        videos={},
    )


def view(entry: Scored) -> CandidateView:
    """The slot without its replies."""
    sample = entry.sample
    return CandidateView(
        generation=sample.generation,
        slot=sample.slot,
        program=sample.candidate,
        verdict=sample.verdict,
        result=entry.result,
    )


def finished() -> RunView:
    """HISTORY with its final trainings: two seeds of the best, the human and the sparse reward."""
    best = Candidate.of(BEST).id
    final = {f"{best}-s1": 46.0, f"{best}-s2": 50.0, "human-s1": 60.0, "human-s2": 62.0, "sparse-s1": 20.0}
    scores = [
        Evaluation(lane=lane, fitness=value - 2, episode_length=9.0, episodes=4, peak="reward")
        for lane, value in final.items()
    ]
    trained_again = [result(lane, value) for lane, value in final.items()]
    found = run(HISTORY, [*BASELINES, *trained_again, result("sparse-s2", None)], scores)
    return replace(found, crown=Place(2, 0))
