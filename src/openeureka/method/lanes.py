"""Trains, plays and scores the lanes that the store does not hold yet."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import cast

from ..config import NO_RANGES, RunConfig
from ..errors import WorkerError
from ..events import Played, Tell
from ..score import counted_peak, level, played
from ..store import Store
from ..types import (
    OWN_REWARDS,
    PEAKS,
    Bonus,
    Evaluation,
    Lane,
    LaneSpec,
    Observe,
    Peak,
    PolicyId,
    Ranges,
    Ranks,
    RewardProgram,
    Scored,
    TrainBudget,
    Trainer,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    Tryout,
    lane_id,
)
from .schedule import RUNGS, WHOLE, Ladder
from .seeds import Wanted, final_lanes

HELD_OUT, CHOOSING, COMPARING, ROBUST = 1_000_003, 2_000_003, 3_000_003, 4_000_003
"""Added to the seed of a run, these give its start states: for final scores, for choosing, for comparing a policy that
was chosen by its final score, and for judging robust policies. No lane trains with them."""
EPISODES = (8, 64)
"""Fewest and most episodes of each policy in each look."""
SHARE = 0.1
"""Share of a training's steps that both looks together may take."""

Sharing = Mapping[str, Sequence[LaneSpec]]
"""All lanes that a training's result is for, by the id of the lane that trains."""


def affordable(trained: Collection[TrainingResult], peaks: int) -> int:
    """Episodes that each of the `peaks` policies of a lane may play in one of two looks. They depend on the mean steps
    of all lanes, so a lane that was cut or diverged early plays as many as the others."""
    fewest, most = EPISODES
    lengths = [length for result in trained for length in result.curves.get("episode_length", ()) if length]
    if not lengths:  # no episode ended: they are longer than the trainings
        return fewest
    steps = sum(result.env_steps for result in trained) / max(1, len(trained))
    return max(fewest, min(most, int(SHARE * steps / (2 * peaks * max(lengths)))))


def drawn(config: RunConfig) -> Ranges | None:
    """Ranges that the worlds of a run are drawn from; None for the task's own world alone."""
    if config.randomise == NO_RANGES:
        return None
    from ..tasks import ranges  # imports the simulator, which a search with fakes does without

    return ranges.find(config.env, config.randomise)


@dataclass(frozen=True, slots=True)
class Lanes:
    """Trains, plays and scores the lanes that the store lacks, and stores what comes."""

    config: RunConfig
    store: Store
    trainer: Trainer
    tell: Tell
    ranks: Ranks = "played"
    """What ranks candidates: with "training", no lane plays."""
    peaks: tuple[Peak, ...] = PEAKS
    """Policies that may stand for a lane: the one that plays best does, or the first where none plays."""

    def train(self, wanted: Iterable[Wanted], *, steps: int = 0) -> dict[str, TrainingResult]:
        """Results of all these lanes, by id; lanes whose result is stored are not trained again.

        Args:
            steps: environment steps of each; 0 for those of the settings.

        Raises:
            WorkerError: when no lane at all could be trained, not even under the task's own reward: that is the
                machine's fault, not a reward's. A single lane that kills its worker has a FAILED result instead.
        """
        lanes = dict(wanted)
        self.store.lanes.add(lanes)
        sharing = self._shared(lanes)
        going = {lane: group[0] for lane, group in sharing.items()}
        raced = self.store.history().lanes  # a program of an earlier generation does not race again
        rivals = frozenset(lane.id for lane in lanes if lane.role == "candidate").difference(raced)
        ladder = Ladder(self.store.lanes, rivals, self.config.cost_limits, self._of_the_moment)
        whole = self._budget(steps)
        for number, rung in enumerate((*RUNGS[self.config.schedule], WHOLE), start=1):
            due = ladder.due(number, rung, going)
            budget = dataclasses.replace(whole, until=rung.share)
            failed: list[TrainingResult] = []
            hear = partial(self._hear, number=number, sharing=sharing, failed=failed)
            for group in _alike(due):
                # No method of its own: few calls of ours may lie between a command and a step of physics.
                events = self.trainer.train(self.config.env, group, budget)
                event: TrainingEvent | None = None
                try:
                    for event in events:
                        hear(event)
                except KeyboardInterrupt as stop:
                    self._hear_out(events, event, hear, stop)
                    raise
                finally:
                    if isinstance(events, Generator):
                        events.close()  # else whoever keeps the error would keep this, and its workers, at work
            # If all of these rewards are generated, the trainer itself has tried the human one.
            all_generated = not any(isinstance(spec.program, str) for spec in due)
            if failed and len(failed) == len(due) and not all_generated and not self._trained(lanes):
                raise WorkerError(failed[0].message)
            for result in failed:
                self._keep(result, sharing[result.lane])
            going, cut = ladder.climb(number, rung, going)
            for result in cut:
                self._keep(result, sharing[result.lane])
        results = self.store.lanes.results()
        return {lane.id: results[lane.id] for lane in lanes}

    def _trained(self, lanes: Iterable[Lane]) -> bool:
        """Whether any of these lanes could be trained, perhaps before the run was stopped: the machine can train."""
        results = self.store.lanes.results()
        known = (results[lane.id] for lane in lanes if lane.id in results)
        return any(result.state is not TrainingState.FAILED for result in known)

    def _shared(self, lanes: Mapping[Lane, RewardProgram]) -> dict[str, list[LaneSpec]]:
        """The lanes without a result, by the one that trains for all that would train alike: programs that differ only
        in comments or local names have equal graphs."""
        known = self.store.lanes.results()
        alike: dict[str, list[LaneSpec]] = {}
        for lane, program in lanes.items():
            if lane.id in known:
                self.store.lanes.forget(lane.id)  # a run killed after the result may have left its snapshot
            else:
                spec = self._spec(lane, program)
                alike.setdefault(f"{lane.seed} {lane.start} {spec.randomise} {program}", []).append(spec)
        return {group[0].id: group for group in alike.values()}

    def _hear_out(
        self,
        events: Iterator[TrainingEvent],
        last: TrainingEvent | None,
        hear: Callable[[TrainingEvent], None],
        stop: KeyboardInterrupt,
    ) -> None:
        """Keep results that had arrived when Ctrl-C came between two events, or while the last one was being stored."""
        if isinstance(last, TrainingResult) and last.lane not in self.store.lanes.results():
            hear(last)
        if isinstance(events, Generator):
            with suppress(StopIteration):
                hear(events.throw(stop))
                for late in events:
                    hear(late)

    def _hear(self, event: TrainingEvent, number: int, sharing: Sharing, failed: list[TrainingResult]) -> None:
        """Store an event on the way to rung `number`; failed lanes are left to the caller, to judge them together."""
        if isinstance(event, TrainingProgress):
            self.tell(event)
        elif event.state is TrainingState.PAUSED:
            self.store.lanes.pause(number, event)
        elif event.state is TrainingState.FAILED:
            failed.append(event)
        else:
            self._keep(event, sharing[event.lane])

    def _budget(self, steps: int) -> TrainBudget:
        """What each lane trains with, if no rung cuts it."""
        return TrainBudget(
            env_steps=steps or self.config.steps,
            worlds=self.config.worlds,
            bonus=cast("Bonus", self.config.bonus),
            randomise=drawn(self.config),
            observe=cast("Observe", self.config.observe),
        )

    def _spec(self, lane: Lane, program: RewardProgram) -> LaneSpec:
        log = self.store.lanes
        ranges = log.ranges()[lane.ranges] if lane.ranges else None
        spec = LaneSpec(id=lane.id, program=program, seed=lane.seed, randomise=ranges)
        if lane.start is None:
            return spec
        policy = lane.start.policy
        rescaled = log.all()[policy.lane].reward != lane.reward
        return dataclasses.replace(spec, start=log.policy(*policy), fresh=lane.start.fresh, rescaled=rescaled)

    def _of_the_moment(self, paused: Mapping[str, TrainingResult]) -> dict[str, Evaluation]:
        """Scores of the newest policies of paused lanes, on start states for choosing."""
        policies = {lane: result.last for lane, result in paused.items() if result.last is not None}
        seed, episodes = self.config.seed + CHOOSING, affordable(paused.values(), 1)
        return {s.lane: s for s in self.trainer.evaluate(self.config.env, policies, seed=seed, episodes=episodes)}

    def _keep(self, result: TrainingResult, specs: Iterable[LaneSpec]) -> None:
        own = [dataclasses.replace(result, lane=spec.id) for spec in specs]
        self.store.lanes.save_results(own)
        self.store.lanes.forget(result.lane)
        for each in own:
            self.tell(each)

    def final(self, entries: Iterable[Scored], seeds: Sequence[int] | None = None) -> dict[str, list[str]]:
        """Lane ids of the final trainings by reward, as far as they are done: see `final_lanes`."""
        return final_lanes(self.config, entries, self.store.lanes.results(), self.store.lanes.plays(), seeds)

    def play(self, ids: Iterable[str]) -> dict[str, Evaluation]:
        """Score of each lane, by the one of its policies that plays best, on start states for choosing; none if
        training ranks.

        First all lanes play some episodes. Then the candidates that are level with the best of them, within the errors
        of both, play some more. All of it takes at most about a tenth of the steps of training.
        """
        if self.ranks == "training":
            return {}
        ids = tuple(dict.fromkeys(ids))
        self._look(0, ids)
        records = self.store.lanes.all()
        rivals = [lane for lane in ids if records[lane].role == "given" or records[lane].reward not in OWN_REWARDS]
        lawful = {lane: s for lane, s in self.first_looks(rivals).items() if not s.broken(self.config.cost_limits)}
        self._look(1, level(lawful))
        scores = self._scores(ids)
        self.tell(Played(scores))
        return scores

    def first_looks(self, ids: Iterable[str]) -> dict[str, Evaluation]:
        """Score of each lane in its first look alone. Whether a lane has had a second one depends on when a run was
        stopped, so a resumed run bases decisions that it makes again on first looks."""
        return self._scores(ids, looks=1)

    def scores(self) -> dict[str, Evaluation]:
        """Score of every lane that has played, over all looks."""
        return self._scores(self.store.lanes.plays())

    def _scores(self, ids: Iterable[str], looks: int | None = None) -> dict[str, Evaluation]:
        plays, limits = self.store.lanes.plays(), self.config.cost_limits
        return {
            lane: played({peak: own[:looks] for peak, own in plays[lane].items()}, limits)
            for lane in ids
            if lane in plays
        }

    def _look(self, look: int, ids: Sequence[str]) -> None:
        """Let the lanes play that have not played in this look yet, side by side on the same start states."""
        known, results, records = self.store.lanes.plays(), self.store.lanes.results(), self.store.lanes.all()
        # A lane whose F is undefined does not play. Exceptions: lanes that were cut before F was first measured, and
        # lanes that continued a policy for too few steps to measure it.
        early = {lane for lane in ids if results[lane].state is TrainingState.CUT or records[lane].start is not None}
        ids = [lane for lane in ids if results[lane].fitness is not None or lane in early]
        missing = [
            Tryout(lane=lane, name=peak, peak=peak)
            for lane in ids
            for peak in self.peaks
            if len(known.get(lane, {}).get(peak, ())) <= look
        ]
        if not missing:
            return
        episodes = affordable([results[lane] for lane in ids], len(self.peaks))
        record = self._evidence(missing) if self.config.screen > 1 and not look else ()
        scores = [score for _, score in self._play(missing, CHOOSING + look, episodes, record)]
        self.store.lanes.save_plays(look, scores)  # all or none: who plays beside whom may change the last bit

    def _evidence(self, looks: Iterable[Tryout]) -> frozenset[str]:
        """Keys of the tryouts that a later screen may judge by: the first policy of each candidate and baseline."""
        roles, firsts = self.store.lanes.all(), dict[str, str]()
        for one in looks:
            if roles[one.lane].role in ("candidate", "baseline"):
                firsts.setdefault(one.lane, _key(one))
        return frozenset(firsts.values())

    def counted_peaks(self, ids: Iterable[str]) -> dict[str, Peak]:
        """The policy that counts for each lane: the one that plays best, or the first of `peaks` if none was played."""
        plays = self.store.lanes.plays()
        limits = self.config.cost_limits
        return {lane: counted_peak(plays.get(lane), self.peaks[0], limits) for lane in ids}

    def judged(self, lane: str) -> PolicyId:
        """The policy of a lane that its held-out score is of; since then it may have played again beside later lanes.
        Without such a score, the one that counts."""
        score = self.store.lanes.evaluations().get(lane)
        return PolicyId(lane, (score.peak if score is not None else None) or self.counted_peaks([lane])[lane])

    def keep(self, best: Scored | None, lane: str | None = None) -> None:
        """Put a reward into `best/`, with the policy of a lane (None: its lane in the search); None empties `best/`."""
        if best is None:  # a person may have rejected the former leader
            return self.store.folders.clear("best")
        lane = lane or lane_id(best.candidate_id, self.config.seed)
        self.store.save_best(best.sample.candidate, PolicyId(lane, self.counted_peaks([lane])[lane]))

    def evaluate(self, ids: Mapping[str, Peak]) -> dict[str, Evaluation]:
        """Held-out score of the named policy of each lane, by lane id; a lane without that policy has none."""
        known = self.store.lanes.evaluations()
        missing = (Tryout(lane=lane, name="", peak=peak) for lane, peak in ids.items() if lane not in known)
        self.store.lanes.save_evaluations([score for _, score in self._play(missing, HELD_OUT)])
        return {lane: score for lane, score in self.store.lanes.evaluations().items() if lane in ids}

    def try_out(self, tryouts: Iterable[Tryout], *, starts: int = HELD_OUT, episodes: int = 0) -> None:
        """Take those of these scores that the store does not hold yet.

        Args:
            starts: `HELD_OUT`, `CHOOSING`, `COMPARING` or `ROBUST`: which start states they are taken on.
            episodes: of each tryout; 0 for as many as a final score needs.
        """
        known = self.store.lanes.tryouts()
        missing = (tryout for tryout in tryouts if tryout.name not in known.get(tryout.lane, {}))
        for tryout, score in self._play(missing, starts, episodes):
            self.store.lanes.save_tryout(tryout.name, score)

    def _play(
        self, tryouts: Iterable[Tryout], starts: int, episodes: int = 0, record: Collection[str] = ()
    ) -> Iterator[tuple[Tryout, Evaluation]]:
        """Scores of tryouts, side by side on the same start states; a tryout whose policy is not stored has none."""
        asked = {_key(tryout): tryout for tryout in tryouts}
        policies = {key: self.store.lanes.policy(tryout.lane, tryout.peak) for key, tryout in asked.items()}
        playing = {key: policy for key, policy in policies.items() if policy is not None}
        if not playing:
            return
        # Only with `screen=`: other trainers, of a person's own, need not know this argument.
        play = partial(self.trainer.evaluate, record=record) if record else self.trainer.evaluate
        for score in play(
            self.config.env,
            playing,
            seed=self.config.seed + starts,
            episodes=episodes,
            dynamics={key: asked[key].dynamics for key in playing},
            untrained={key: seed for key in playing if (seed := asked[key].untrained) is not None},
        ):
            tryout = asked[score.lane]
            peak = tryout.peak if tryout.untrained is None else None
            yield tryout, dataclasses.replace(score, lane=tryout.lane, peak=peak)


def _key(tryout: Tryout) -> str:
    """The id under which the trainer knows a tryout."""
    return f"{tryout.lane} {tryout.name}".rstrip()


def _alike(due: Sequence[LaneSpec]) -> list[list[LaneSpec]]:
    """Lanes that go on, and those that begin anew since their state at a rung is lost: none trains with the others."""
    groups = [[spec for spec in due if (spec.paused is None) == anew] for anew in (False, True)]
    return [group for group in groups if group]
