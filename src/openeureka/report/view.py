"""Everything that reports, tables and pages show of a run, read once from its store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from .. import score, strategies
from ..config import NO_MODEL, RunConfig
from ..method import baselines, hacking, race
from ..method.baselines import Baselines
from ..method.hacking import Sign, Tried
from ..method.seeds import final_lanes
from ..refine import hardened, polishing, tuned
from ..refine.hardened import Robust
from ..refine.polishing import Polished
from ..refine.tuned import ORIGINAL, Tuned
from ..score import Outcome, SeedScores
from ..store import Store, artifacts
from ..types import (
    OWN_REWARDS,
    Candidate,
    CandidateId,
    Evaluation,
    History,
    Lane,
    Place,
    PolicyId,
    Ranks,
    Remark,
    TrainingResult,
    Usage,
    lane_id,
)
from .candidates import CandidateView, GenerationView, Reader

VIDEO = "video.mp4"
FOLDERS = ("best", "polished", "robust")
"""Folders of the policies that a run has found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunView:
    """A run as far as it has come."""

    config: RunConfig
    history: History
    """The finished generations, as the search knows them."""
    generations: tuple[GenerationView, ...]
    """The same as people see them, and the generation under way."""
    results: Mapping[str, TrainingResult]
    """By lane id; checkpoints without their policies."""
    evaluations: Mapping[str, Evaluation]
    tryouts: Mapping[str, Mapping[str, Evaluation]]
    """Further held-out scores of the best reward's policies, by lane id and name (see `method.hacking`)."""
    usage: Usage
    videos: Mapping[str, str]
    """Path in the run directory by lane id, and of what the run has found by the names of `FOLDERS`."""
    lanes: Mapping[str, Lane] = field(default_factory=dict)
    """By id, trained or under way."""
    played: Mapping[str, Evaluation] = field(default_factory=dict)
    """By lane id: scores in the episodes that rewards are ranked by."""
    ranks: Ranks = "training"
    """By which F the search ranks candidates."""
    crown: Place | None = None
    """The candidate that won the race."""
    best_policy: PolicyId | None = None
    """The best policy, whatever it was trained with, where `polish=` trained one further."""
    robust: Robust | None = None
    """What `eureka robust` has found so far; None where it was never called."""
    unheard: tuple[Remark, ...] = ()
    """What a person said that no prompt has taken up yet."""
    ended: bool = False
    """Whether the search is done and only reports are left to write."""
    texts: Mapping[str, Candidate] = field(default_factory=dict)
    """Given rewards and weightings by name; not those that come with the task."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Why weightings were refused, by name."""

    @staticmethod
    def read(directory: Path) -> RunView:
        """Read a run, also while it is going on. Raises StoreError when there is none."""
        with Store.view(directory) as store, store.moment():
            results = store.lanes.results()
            config, history = store.config, store.history(results)
            videos = _videos(directory, results)
            played = {lane: score.played(plays, config.cost_limits) for lane, plays in store.lanes.plays().items()}
            return RunView(
                config=config,
                history=history,
                generations=Reader(store, config, history, results, played, videos).generations(),
                lanes=store.lanes.all(),
                results=results,
                evaluations=store.lanes.evaluations(),
                tryouts=store.lanes.tryouts(),
                usage=store.talk.usage(),
                played=played,
                ranks=store.ranks,
                crown=store.crown(),
                best_policy=store.lanes.best_policy(),
                robust=hardened.read(store, results),
                unheard=store.remarks.unheard(),
                ended=store.ended,
                texts=store.rewards.texts(),
                refused=_refused(store),
                videos=videos,
            )

    @property
    def searched(self) -> bool:
        """Whether it is a search; else it compares given rewards."""
        return self.config.model != NO_MODEL

    @property
    def tunes(self) -> bool:
        """Whether it fits the numbers of one reward, and does nothing else."""
        return self.config.tune > 0 and not self.searched

    @property
    def tuned(self) -> Tuned | None:
        """What the fitting of a reward's numbers has found so far; None where there is none."""
        if not self.config.tune:
            return None
        found = tuned.read(self.config, self.texts, self.results, self.played, self.evaluations)
        if found is None:
            return None
        return replace(found, judged=found.judged or self.ended, lost={**self.refused, **found.lost})

    @property
    def polished(self) -> Polished | None:
        """What came of training the best policy further; None where none was."""
        best, limits = self.best_policy, self.config.cost_limits
        return polishing.read(self.lanes, self.results, self.played, self.tryouts, best, limits)

    @property
    def given(self) -> dict[str, SeedScores]:
        """Scores of the given rewards by name, as far as they are trained; a value for each seed."""
        lanes: dict[str, list[str]] = {}
        for lane in self.lanes.values():
            if lane.role == "given" and lane.id in self.results:
                lanes.setdefault(lane.reward, []).append(lane.id)
        return {name: SeedScores.of(own, self.results, self.evaluations) for name, own in lanes.items()}

    @property
    def untrained(self) -> list[float]:
        """Held-out F of policies that never trained, a value per seed."""
        return [fitness for own in self.tryouts.values() for fitness in hacking.untrained(own)]

    @property
    def noisy(self) -> bool:
        """Whether policies play with the noise of training, because all episodes of the task begin alike."""
        return any(score.noisy for score in self.evaluations.values())

    @property
    def candidates(self) -> tuple[CandidateView, ...]:
        return tuple(candidate for generation in self.generations for candidate in generation.candidates)

    @property
    def ranking(self) -> strategies.Ranking:
        return strategies.Ranking(self.history)

    @property
    def best(self) -> CandidateView | None:
        """The candidate that won the race; before that the first in the ranking of the finished generations."""
        best = self.history.entry(self.crown) or self.ranking.best
        return next((c for c in self.candidates if best is not None and c.place == best.sample.place), None)

    @property
    def fitted(self) -> Candidate | None:
        """The best reward of a search with fitted numbers, where these are better: then `best/` holds it."""
        found = self.tuned if self.searched else None
        return self.texts[found.better] if found is not None and found.better != ORIGINAL else None

    @property
    def best_text(self) -> Candidate | None:
        """The program of the best reward, with fitted numbers where those are better."""
        return self.fitted or (self.best.program if self.best is not None else None)

    @property
    def baselines(self) -> dict[str, TrainingResult]:
        """The trainings of `human` and `sparse` that the candidates were compared with, as far as they are done."""
        lanes = {name: lane_id(name, self.config.seed) for name in OWN_REWARDS}
        return {name: self.results[lane] for name, lane in lanes.items() if lane in self.results}

    def baseline_score(self, name: str) -> float | None:
        """F of a baseline in the search, by the measure that ranks candidates: played, or in training."""
        result = self.baselines[name]
        played = self.played.get(result.lane)
        return played.fitness if played is not None else result.fitness

    @property
    def places(self) -> dict[CandidateId, Place]:
        """The first slot that holds each program: people know the program by it."""
        return {own.program.id: own.place for own in reversed(self.candidates) if own.program is not None}

    @property
    def twins(self) -> dict[Place, Place]:
        """Candidates with the program of an earlier one, mapped to that earlier one, which trained for both."""
        first = self.places
        return {
            own.place: first[own.program.id]
            for own in self.candidates
            if own.program is not None and first[own.program.id] != own.place
        }

    @property
    def highest(self) -> float | None:
        """The highest F of any training; None before there is one."""
        return max((own.fitness for own in self.results.values() if own.fitness is not None), default=None)

    @property
    def known_baselines(self) -> Baselines | None:
        """Baselines that were measured beforehand, where the run does not train them."""
        return baselines.chosen(self.config)

    @property
    def outcome(self) -> Outcome | None:
        """The final comparison; None before all its trainings are done."""
        if self.crown is None:
            return None
        return race.outcome(self.config, self.history, self.crown, self.results, self.evaluations, self.tryouts)

    @property
    def tried(self) -> tuple[Tried, ...]:
        """The best reward's final trainings with all their held-out scores; empty before those are taken."""
        best = self.history.entry(self.crown)
        if best is None or not self.tryouts:
            return ()
        lanes = final_lanes(self.config, [best], self.results, self.evaluations)
        final = {lane: self.results[lane] for lane in lanes[best.candidate_id]}
        return tuple(hacking.tried(final, self.evaluations, self.tryouts))

    @property
    def signs(self) -> tuple[Sign, ...]:
        """What suggests that the best reward is exploited rather than fulfilled."""
        return hacking.signs(self.tried, self.config.cost_limits)


def _refused(store: Store) -> dict[str, str]:
    """Why weightings were refused, by name. A refused one has no lane. Other given rewards need no look: a run does not
    begin with one that was refused."""
    lanes = {lane.reward for lane in store.lanes.all().values()}
    waiting = {name: own.id for name, own in store.rewards.texts().items() if store.config.tune and own.id not in lanes}
    verdicts = {name: store.rewards.verdict(own) for name, own in waiting.items()}
    return {
        name: "; ".join(finding.sentence() for finding in verdict.findings) or verdict.code
        for name, verdict in verdicts.items()
        if verdict is not None and not verdict.accepted
    }


def _videos(directory: Path, results: Mapping[str, TrainingResult]) -> dict[str, str]:
    places = {lane: f"lanes/{lane}/{VIDEO}" for lane in results} | {name: f"{name}/{VIDEO}" for name in FOLDERS}
    return {name: place for name, place in places.items() if artifacts.exists(directory, place)}
