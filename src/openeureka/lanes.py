"""Trains and scores what the store does not hold yet, and names every lane."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .config import RunConfig
from .errors import WorkerError
from .hacking import Trial
from .observer import Observer
from .store import Peak, Store
from .types import (
    CandidateId,
    Evaluation,
    RewardProgram,
    Sample,
    Scored,
    TrainBudget,
    Trainer,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    TrainJob,
)

BASELINES: tuple[tuple[str, RewardProgram], ...] = (("human", "human"), ("sparse", "sparse"))


def lane(name: str, seed: int) -> str:
    """The job id of a reward (candidate id, `human` or `sparse`) and a seed."""
    return f"{name}-s{seed}"


def programs(samples: Iterable[Sample]) -> list[tuple[CandidateId, RewardProgram]]:
    """The accepted programs; equal ones once."""
    graphs = {sample.verdict.candidate: sample.verdict.graph for sample in samples}
    return [(candidate, graph) for candidate, graph in graphs.items() if graph is not None]


def beside(config: RunConfig) -> tuple[tuple[str, RewardProgram], ...]:
    """The rewards that candidates are compared with, as far as the run trains them itself."""
    return BASELINES if config.baselines == "train" else ()


def final_seeds(config: RunConfig) -> range:
    """Seeds of the final trainings; the search trains with `config.seed`."""
    return range(config.seed + 1, config.seed + 1 + config.seeds)


def final_lanes(config: RunConfig, best: Scored) -> dict[str, list[str]]:
    """Job ids of the final trainings: those of the best reward (`method`), and of each baseline that is trained."""
    names = {"method": best.sample.verdict.candidate, **{name: name for name, _ in beside(config)}}
    return {arm: [lane(name, seed) for seed in final_seeds(config)] for arm, name in names.items()}


@dataclass(frozen=True, slots=True)
class Lanes:
    """A Trainer that remembers through the store."""

    config: RunConfig
    store: Store
    trainer: Trainer
    observer: Observer

    def train(self, rewards: Iterable[tuple[str, RewardProgram]], seeds: Sequence[int]) -> dict[str, TrainingResult]:
        """Results of every reward with every seed, by job id.

        Raises:
            WorkerError: when no lane at all could be trained, nor the task's own reward: the machine's fault, not a
                reward's. A lane that ends its worker by itself has a result that says so.
        """
        jobs = [
            TrainJob(id=lane(name, seed), program=program, seed=seed) for name, program in rewards for seed in seeds
        ]
        known = self.store.results()
        # Programs that differ only in comments or local names have equal graphs: they train once and share the result.
        twins: dict[str, list[TrainJob]] = {}
        for job in jobs:
            if job.id not in known:
                twins.setdefault(f"{job.seed} {job.program}", []).append(job)
        wanted = [group[0] for group in twins.values()]
        sharing = {group[0].id: group for group in twins.values()}
        budget = TrainBudget(
            env_steps=self.config.steps, worlds=self.config.worlds, bonus=self.config.bonus == "original"
        )
        failed: list[TrainingResult] = []
        for event in self.trainer.train(self.config.env, wanted, budget) if wanted else ():
            if isinstance(event, TrainingProgress):
                self.observer.progress(event)
            elif event.state is TrainingState.FAILED:
                failed.append(event)
            else:
                self._keep(event, sharing[event.job])
        if failed and len(failed) == len(wanted) and any(isinstance(job.program, str) for job in wanted):
            raise WorkerError(failed[0].message)
        for result in failed:
            self._keep(result, sharing[result.job])
        results = self.store.results()
        return {job.id: results[job.id] for job in jobs}

    def _keep(self, result: TrainingResult, jobs: Iterable[TrainJob]) -> None:
        for job in jobs:
            own = dataclasses.replace(result, job=job.id)
            self.store.save_result(own)
            self.observer.result(own)

    def evaluate(self, jobs: Iterable[str], peak: Peak) -> dict[str, Evaluation]:
        """Held-out scores by job id, of those lanes that left a policy."""
        jobs = tuple(jobs)
        known = self.store.evaluations()
        policies = {job: self.store.policy(job, peak) for job in jobs if job not in known}
        missing = {job: policy for job, policy in policies.items() if policy is not None}
        for evaluation in self.trainer.evaluate(self.config.env, missing, seed=self._held_out) if missing else ():
            self.store.save_evaluation(evaluation)
        return {job: score for job, score in self.store.evaluations().items() if job in jobs}

    def try_out(self, trials: Iterable[Trial]) -> None:
        """Take the scores that the store does not hold yet, on the start states of `evaluate`."""
        known = self.store.trials()
        missing = {f"{trial.job} {trial.name}": trial for trial in trials if trial.name not in known.get(trial.job, {})}
        policies = {key: self.store.policy(trial.job, trial.peak) for key, trial in missing.items()}
        playing = {key: policy for key, policy in policies.items() if policy is not None}
        dynamics = {key: missing[key].dynamics for key in playing}
        if not playing:
            return
        for score in self.trainer.evaluate(self.config.env, playing, seed=self._held_out, dynamics=dynamics):
            trial = missing[score.job]
            self.store.save_trial(trial.name, dataclasses.replace(score, job=trial.job))

    @property
    def _held_out(self) -> int:
        """A seed that no lane trained with."""
        return self.config.seed + 1_000_003
