"""Everything that reports, tables and pages show of a run, read once from its store."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from random import Random
from typing import Literal

from .. import baselines, hacking, prompts, race, score, search
from ..config import RunConfig
from ..hacking import Sign, Tried
from ..lanes import BASELINES, beside, final_lanes, final_seeds, lane
from ..llm import extract
from ..sampling import NO_PROGRAM
from ..score import Baselines, Outcome
from ..store import Store, artifacts
from ..types import (
    Candidate,
    Evaluation,
    History,
    Message,
    Peak,
    Place,
    Prompt,
    Remark,
    Reply,
    Sample,
    Scored,
    TrainingResult,
    TrainingState,
    Usage,
    Verdict,
)

VIDEO = "video.mp4"


class CandidateState(StrEnum):
    """How far a slot has come."""

    DRAWN = "drawn"  # a reply is there, its program is not judged yet
    REFUSED = "refused"
    ACCEPTED = "accepted"  # not trained yet
    TRAINED = "trained"
    DIVERGED = "diverged"
    FAILED = "failed"


_TRAINED = {
    TrainingState.FINISHED: CandidateState.TRAINED,
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
    """By job id; checkpoints without their policies."""
    evaluations: Mapping[str, Evaluation]
    trials: Mapping[str, Mapping[str, Evaluation]]
    """Further held-out scores of the best reward's policies, by job id and name (see `hacking`)."""
    usage: Usage
    videos: Mapping[str, str]
    """Path in the run directory by job id, and of the best policy by `best`."""
    played: Mapping[str, Evaluation] = field(default_factory=dict)
    """By job id: what lanes scored when they were played to choose by."""
    ranks: Literal["played", "training"] = "training"
    """By which F the search ranks."""
    crown: Place | None = None
    """The candidate that the final trainings confirmed."""
    unheard: tuple[Remark, ...] = ()
    """What a person said that no prompt has taken up yet."""

    @staticmethod
    def read(directory: Path, earlier: RunView | None = None) -> RunView:
        """Read a run, also while it is going on. Raises StoreError when there is none.

        What an earlier view of it holds is not decoded again: most of the time goes into curves and programs.
        """
        with Store.view(directory) as store:
            results = store.results(earlier.results if earlier is not None else {})
            config, history = store.config, store.history(results)
            videos = _videos(directory, results)
            programs = earlier.programs if earlier is not None else {}
            strategy = search.recorded(config, store.ranks)
            played = {job: score.played(plays) for job, plays in store.plays().items()}
            reader = _Reader(
                config, history, strategy, search.Ranking(history), results, played, videos, programs, store
            )
            return RunView(
                config=config,
                history=history,
                generations=reader.generations(),
                results=results,
                evaluations=store.evaluations(),
                trials=store.trials(),
                usage=store.usage(),
                played=played,
                ranks=strategy.judge if strategy is not None else "played" if played else "training",
                crown=store.crown(),
                unheard=store.remarks.unheard(),
                videos=videos,
            )

    @property
    def candidates(self) -> tuple[CandidateView, ...]:
        return tuple(candidate for generation in self.generations for candidate in generation.candidates)

    @property
    def programs(self) -> dict[str, Candidate | None]:
        """What was found in each reply, by its text."""
        return {a.reply.text: a.candidate for candidate in self.candidates for a in candidate.attempts}

    @property
    def ranking(self) -> search.Ranking:
        return search.Ranking(self.history)

    @property
    def best(self) -> CandidateView | None:
        """The confirmed one; before that the first in the ranking of the finished generations."""
        best = race.crowned(self.history, self.crown)
        return next((c for c in self.candidates if best is not None and c.place == best.sample.place), None)

    @property
    def baselines(self) -> dict[str, TrainingResult]:
        """The trainings of `human` and `sparse` that the candidates were compared with, as far as they are done."""
        jobs = {name: lane(name, self.config.seed) for name, _ in BASELINES}
        return {name: self.results[job] for name, job in jobs.items() if job in self.results}

    def baseline_score(self, name: str) -> float | None:
        """What a baseline scored beside the search, as candidates are ranked: played, or in training."""
        result = self.baselines[name]
        played = self.played.get(result.job)
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
        jobs = [lane(name, seed) for name in names for seed in final_seeds(self.config)]
        return self.ranks == "training" and all(job in self.results for job in jobs)

    @property
    def tried(self) -> tuple[Tried, ...]:
        """The best reward's final trainings with all their held-out scores; empty before those are taken."""
        best = race.crowned(self.history, self.crown)
        if best is None or self.outcome is None or not self.trials:
            return ()
        arms = final_lanes(self.config, [best], self.results, self.evaluations)
        final = {job: self.results[job] for job in arms[best.sample.verdict.candidate]}
        unsaid: Peak = "fitness" if self.config.search == "eureka" else "reward"  # by versions before
        return tuple(hacking.tried(final, self.evaluations, self.trials, unsaid))

    @property
    def signs(self) -> tuple[Sign, ...]:
        """What suggests that the best reward is exploited rather than fulfilled."""
        return hacking.signs(self.tried)


def _videos(directory: Path, results: Mapping[str, TrainingResult]) -> dict[str, str]:
    places = {job: f"lanes/{job}/{VIDEO}" for job in results} | {"best": f"best/{VIDEO}"}
    return {name: place for name, place in places.items() if artifacts.exists(directory, place)}


@dataclass(frozen=True, slots=True)
class _Reader:
    """Puts together what the store keeps in separate tables."""

    config: RunConfig
    history: History
    strategy: search.SearchStrategy | None
    ranking: search.Ranking
    results: Mapping[str, TrainingResult]
    played: Mapping[str, Evaluation]
    videos: Mapping[str, str]
    programs: Mapping[str, Candidate | None]
    """Known ones, by the text of the reply."""
    store: Store

    def generations(self) -> tuple[GenerationView, ...]:
        asked, replies = self.store.prompts(), self.store.placed_replies()
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
            parents = self._parents(index, [prompt.slot for prompt in requests], drawn)
            candidates = [self._candidate(index, slot, drawn[slot], parents.get(slot)) for slot in sorted(drawn)]
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

    def _parents(self, index: int, asked: Sequence[int], slots: Iterable[int]) -> dict[int, Sample]:
        """Parent by slot. Where the store did not keep it, the strategy is asked again: it has no state."""
        kept = {first: place for (generation, first), place in self.store.parents().items() if generation == index}
        if kept or self.strategy is None or self.strategy.judge == "played":
            entries = {e.sample.place: e.sample for g in self.history.generations for e in g.entries}
            firsts = {slot: max((first for first in asked if first <= slot), default=0) for slot in slots}
            return {slot: entries[kept[first]] for slot, first in firsts.items() if first in kept}
        before = replace(self.history, generations=self.history.generations[:index])
        plans = self.strategy.ask(before, Random(f"{self.config.seed}/{index}"))
        parents = [plan.turns[-1].sample if plan.turns else None for plan in plans for _ in range(plan.count)]
        return {slot: parent for slot, parent in enumerate(parents) if parent is not None}

    def _candidate(self, index: int, slot: int, replies: Mapping[int, Reply], parent: Sample | None) -> CandidateView:
        attempts = self._attempts(replies)
        entry = self._entry(index, slot)
        candidate = entry.sample.candidate if entry is not None else attempts[-1].candidate
        verdict = entry.sample.verdict if entry is not None else attempts[-1].verdict
        job = lane(candidate.id, self.config.seed) if candidate is not None else ""
        return CandidateView(
            generation=index,
            slot=slot,
            candidate=candidate,
            verdict=verdict,
            result=entry.result if entry is not None else self.results.get(job),
            played=entry.played if entry is not None else self.played.get(job),
            feedback=entry.feedback if entry is not None else "",
            parent=parent,
            attempts=attempts,
            video=self.videos.get(job, ""),
            strength=self.ranking.strengths.get(candidate.id) if candidate is not None else None,
            vetoed=candidate is not None and candidate.id in self.ranking.rejected,
        )

    def _entry(self, index: int, slot: int) -> Scored | None:
        if index >= len(self.history.generations):
            return None
        return next((e for e in self.history.generations[index].entries if e.sample.slot == slot), None)

    def _attempts(self, replies: Mapping[int, Reply]) -> tuple[AttemptView, ...]:
        """In order; which of them were repairs follows from their number, as in `sampling`."""
        attempts: list[AttemptView] = []
        for number, reply in replies.items():
            repair: tuple[Message, ...] = ()
            if number % (1 + self.config.repair) and attempts and (refusal := attempts[-1].verdict) is not None:
                repair = prompts.repair(Prompt(messages=()), attempts[-1].reply.text, refusal).messages
            candidate = self._program(reply.text)
            verdict = self.store.verdict(candidate.id) if candidate is not None else NO_PROGRAM
            attempts.append(AttemptView(repair=repair, reply=reply, candidate=candidate, verdict=verdict))
        return tuple(attempts)

    def _program(self, text: str) -> Candidate | None:
        if text in self.programs:
            return self.programs[text]
        source = extract.program(text)
        return Candidate.of(source) if source is not None else None
