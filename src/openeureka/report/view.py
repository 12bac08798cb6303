"""Everything that reports, tables and pages show of a run, read once from its store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Literal

from .. import baselines, hacking, hardened, polished, race, score, screen, strategies, tuned
from ..config import NO_MODEL, RunConfig
from ..hacking import Sign, Tried
from ..hardened import Robust
from ..lanes import BASELINES, beside, final_lanes, final_seeds
from ..polished import Polished
from ..sampling import NO_PROGRAM
from ..score import Arm, Baselines, Outcome
from ..store import Store, artifacts
from ..tuned import Tuned
from ..types import (
    Attempt,
    Candidate,
    Evaluation,
    History,
    Lane,
    Message,
    Peak,
    Place,
    PolicyId,
    Remark,
    Reply,
    Sample,
    Scored,
    Screened,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
    VerdictCode,
    lane_id,
)

VIDEO = "video.mp4"


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
    candidate: Candidate | None
    verdict: Verdict | None
    """None: not judged yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateView:
    """A slot of a generation: the program it holds, where it came from and what became of it."""

    generation: int
    slot: int
    candidate: Candidate | None
    """The program of the last reply; None when that held none."""
    verdict: Verdict | None
    result: TrainingResult | None = None
    played: Evaluation | None = None
    """What its policy scored when it was played to choose by."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class RunView:
    """A run as far as it has come."""

    config: RunConfig
    history: History
    """The finished generations, as the search knows them."""
    generations: tuple[GenerationView, ...]
    """The same for people, and the one under way."""
    results: Mapping[str, TrainingResult]
    """By lane; checkpoints without their policies."""
    evaluations: Mapping[str, Evaluation]
    trials: Mapping[str, Mapping[str, Evaluation]]
    """Further held-out scores of the best reward's policies, by lane id and name (see `hacking`)."""
    usage: Usage
    videos: Mapping[str, str]
    """Path in the run directory by lane id, of the best reward's policy by `best`, of one carried on by `polished`."""
    lanes: Mapping[str, Lane] = field(default_factory=dict)
    """By id, trained or under way."""
    played: Mapping[str, Evaluation] = field(default_factory=dict)
    """By lane id: what lanes scored when they were played to choose by."""
    ranks: Literal["played", "training"] = "training"
    """By which F the search ranks."""
    crown: Place | None = None
    """The candidate that the final trainings confirmed."""
    best_policy: PolicyId | None = None
    """The best policy as it is, where one was carried on."""
    robust: Robust | None = None
    """How a policy was made that works in hard worlds; None where none was."""
    unheard: tuple[Remark, ...] = ()
    """What a person said that no prompt has taken up yet."""
    texts: Mapping[str, Candidate] = field(default_factory=dict)
    """Given rewards and weightings by name; not those that come with the task."""

    @staticmethod
    def read(directory: Path, earlier: RunView | None = None) -> RunView:
        """Read a run, also while it is going on. Raises StoreError when there is none.

        What an earlier view of it holds is not decoded again: most of the time goes into curves.
        """
        with Store.view(directory) as store:
            results = store.lanes.results(earlier.results if earlier is not None else {})
            config, history = store.config, store.history(results)
            videos = _videos(directory, results)
            played = {lane: score.played(plays, config.limited) for lane, plays in store.lanes.plays().items()}
            reader = _Reader(
                config=config,
                history=history,
                entries={entry.sample.place: entry for g in history.generations for entry in g.entries},
                parents={} if config.model == "random" else store.talk.parents(),  # chance reads no parent
                attempts=store.attempts(),
                ranking=strategies.Ranking(history),
                results=results,
                played=played,
                videos=videos,
                screens=store.screens.all(),
                store=store,
            )
            return RunView(
                config=config,
                history=history,
                generations=reader.generations(),
                lanes=store.lanes.all(),
                results=results,
                evaluations=store.lanes.evaluations(),
                trials=store.lanes.trials(),
                usage=store.talk.usage(),
                played=played,
                ranks="training" if config.search == "eureka" else store.ranks,
                crown=store.crown(),
                best_policy=store.lanes.best_policy(),
                robust=hardened.read(store, results),
                unheard=store.remarks.unheard(),
                texts=store.texts(),
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
        return tuned.read(self.config, self.texts, self.results, self.played, self.evaluations)

    @property
    def polished(self) -> Polished | None:
        """What came of carrying the best policy on; None where none is."""
        return polished.read(self.lanes, self.results, self.played, self.evaluations, self.best_policy)

    @property
    def given(self) -> dict[str, Arm]:
        """Scores of the given rewards by name, as far as they are trained; a value a seed."""
        lanes = [lane for lane in self.lanes.values() if lane.role == "given" and lane.id in self.results]
        return {
            name: Arm(
                training=tuple(self.results[lane.id].fitness for lane in lanes if lane.reward == name),
                held_out=tuple(
                    self.evaluations[lane.id].fitness if lane.id in self.evaluations else None
                    for lane in lanes
                    if lane.reward == name
                ),
            )
            for name in dict.fromkeys(lane.reward for lane in lanes)
        }

    @property
    def candidates(self) -> tuple[CandidateView, ...]:
        return tuple(candidate for generation in self.generations for candidate in generation.candidates)

    @property
    def ranking(self) -> strategies.Ranking:
        return strategies.Ranking(self.history)

    @property
    def best(self) -> CandidateView | None:
        """The confirmed one; before that the first in the ranking of the finished generations."""
        best = race.crowned(self.history, self.crown)
        return next((c for c in self.candidates if best is not None and c.place == best.sample.place), None)

    @property
    def baselines(self) -> dict[str, TrainingResult]:
        """The trainings of `human` and `sparse` that the candidates were compared with, as far as they are done."""
        lanes = {name: lane_id(name, self.config.seed) for name, _ in BASELINES}
        return {name: self.results[lane] for name, lane in lanes.items() if lane in self.results}

    def baseline_score(self, name: str) -> float | None:
        """What a baseline scored beside the search, as candidates are ranked: played, or in training."""
        result = self.baselines[name]
        played = self.played.get(result.lane)
        return played.fitness if played is not None else result.fitness

    @property
    def known(self) -> Baselines | None:
        """Baselines that were measured beforehand, where the run does not train them."""
        return baselines.chosen(self.config)

    @property
    def outcome(self) -> Outcome | None:
        """The final comparison; None before all its trainings are done."""
        if self.crown is None and not self._unraced:
            return None
        return race.outcome(self.config, self.history, self.crown, self.results, self.evaluations)

    @property
    def _unraced(self) -> bool:
        """Whether it was finished by a version that kept no crown."""
        best = self.ranking.best
        names = [best.sample.verdict.candidate if best is not None else "", *(name for name, _ in beside(self.config))]
        lanes = [lane_id(name, seed) for name in names for seed in final_seeds(self.config)]
        return self.ranks == "training" and all(lane in self.results for lane in lanes)

    @property
    def tried(self) -> tuple[Tried, ...]:
        """The best reward's final trainings with all their held-out scores; empty before those are taken."""
        best = race.crowned(self.history, self.crown)
        if best is None or self.outcome is None or not self.trials:
            return ()
        arms = final_lanes(self.config, [best], self.results, self.evaluations)
        final = {lane: self.results[lane] for lane in arms[best.sample.verdict.candidate]}
        unsaid: Peak = "fitness" if self.config.search == "eureka" else "reward"  # by versions before
        return tuple(hacking.tried(final, self.evaluations, self.trials, unsaid))

    @property
    def signs(self) -> tuple[Sign, ...]:
        """What suggests that the best reward is exploited rather than fulfilled."""
        return hacking.signs(self.tried, self.config.limited)


def _videos(directory: Path, results: Mapping[str, TrainingResult]) -> dict[str, str]:
    places = {lane: f"lanes/{lane}/{VIDEO}" for lane in results} | {
        name: f"{name}/{VIDEO}" for name in ("best", "polished", "robust")
    }
    return {name: place for name, place in places.items() if artifacts.exists(directory, place)}


@dataclass(frozen=True, slots=True)
class _Reader:
    """Puts together what the store keeps in separate tables."""

    config: RunConfig
    history: History
    entries: Mapping[Place, Scored]
    """Those of the finished generations."""
    parents: Mapping[Place, Place]
    attempts: Mapping[tuple[int, int, int], Attempt]
    ranking: strategies.Ranking
    results: Mapping[str, TrainingResult]
    played: Mapping[str, Evaluation]
    videos: Mapping[str, str]
    screens: Mapping[Place, Screened]
    store: Store

    def generations(self) -> tuple[GenerationView, ...]:
        asked, replies = self.store.talk.prompts(), self.store.talk.placed_replies()
        done = len(self.history.generations)
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
                    remarks=self.history.generations[index].remarks if index < done else (),
                )
            )
        return tuple(views)

    def _candidate(self, place: Place, replies: Mapping[int, Reply]) -> CandidateView:
        attempts = tuple(self._attempt(place, number, reply) for number, reply in replies.items())
        entry = self.entries.get(place)
        candidate = entry.sample.candidate if entry is not None else attempts[-1].candidate
        verdict = entry.sample.verdict if entry is not None else attempts[-1].verdict
        if entry is None and candidate is not None and place in self.screens and not self.screens[place].kept:
            verdict = screen.verdict(candidate.id, self.screens[place])
        lane = lane_id(candidate.id, self.config.seed) if candidate is not None else ""
        parent = self.entries.get(self.parents[place]) if place in self.parents else None
        return CandidateView(
            generation=place.generation,
            slot=place.slot,
            candidate=candidate,
            verdict=verdict,
            result=entry.result if entry is not None else self.results.get(lane),
            played=entry.played if entry is not None else self.played.get(lane),
            feedback=entry.feedback if entry is not None else "",
            parent=parent.sample if parent is not None else None,
            attempts=attempts,
            video=self.videos.get(lane, ""),
            strength=self.ranking.strengths.get(candidate.id) if candidate is not None else None,
            vetoed=candidate is not None and candidate.id in self.ranking.rejected,
        )

    def _attempt(self, place: Place, number: int, reply: Reply) -> AttemptView:
        found = self.attempts.get((place.generation, number, place.slot))
        if found is None:
            return AttemptView(repair=(), reply=reply, candidate=None, verdict=None)
        verdict = self.store.verdict(found.candidate.id) if found.candidate is not None else NO_PROGRAM
        return AttemptView(repair=found.repair, reply=reply, candidate=found.candidate, verdict=verdict)
