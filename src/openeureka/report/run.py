"""Everything that reports and tables show of a run, read once from its store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .. import baselines
from ..config import RunConfig
from ..lanes import BASELINES, final_lanes, lane
from ..score import Baselines, Outcome, compare
from ..store import Store
from ..types import Evaluation, History, TrainingResult, Usage


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run as far as it has come."""

    config: RunConfig
    history: History
    results: Mapping[str, TrainingResult]
    """By job id; checkpoints without their policies."""
    evaluations: Mapping[str, Evaluation]
    usage: Usage

    @staticmethod
    def read(store: Store) -> Run:
        return Run(
            config=store.config,
            history=store.history(),
            results=store.results(),
            evaluations=store.evaluations(),
            usage=store.usage(),
        )

    @property
    def baselines(self) -> dict[str, TrainingResult]:
        """The trainings of `human` and `sparse` that the candidates were compared with, as far as they are done."""
        jobs = {name: lane(name, self.config.seed) for name, _ in BASELINES}
        return {name: self.results[job] for name, job in jobs.items() if job in self.results}

    @property
    def known(self) -> Baselines | None:
        """Baselines that were measured beforehand, where the run does not train them."""
        return baselines.chosen(self.config)

    @property
    def outcome(self) -> Outcome | None:
        """The final comparison; None before all its trainings are done."""
        best = self.history.best
        if best is None:
            return None
        arms = final_lanes(self.config, best)
        if any(job not in self.results for jobs in arms.values() for job in jobs):
            return None
        return compare(best, arms, self.results, self.evaluations, self.known)
