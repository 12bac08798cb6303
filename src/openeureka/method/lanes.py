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
"""Added to the seed of a run: start states of its final scores, those it chooses by, those on which a policy that was
chosen by its final score is compared, and those on which robust policies are judged. No lane trains with them."""
EPISODES = (8, 64)
"""Of each policy and look, the least and the most."""
SHARE = 0.1
"""Of the steps of a training that both looks may take together."""

Sharing = Mapping[str, Sequence[LaneSpec]]
"""By the id of the lane that trains: all lanes that its result is for."""


def affordable(trained: Collection[TrainingResult], peaks: int) -> int:
    """Episodes that each of so many policies of a lane may play in one of two looks. Lanes share what they trained: one
    that was cut or diverged early takes no episodes from the others."""
    fewest, most = EPISODES
    lengths = [length for result in trained for length in result.curves.get("episode_length", ()) if length]
    if not lengths:  # episodes are longer than the trainings were
        return fewest
    steps = sum(result.env_steps for result in trained) / max(1, len(trained))
    return max(fewest, min(most, int(SHARE * steps / (2 * peaks * max(lengths)))))


def drawn(config: RunConfig) -> Ranges | None:
    """What the worlds of a run are drawn from; None for the task's own alone."""
    if config.randomise == NO_RANGES:
        return None
    from ..tasks import ranges  # knows the simulator, which a search of fakes does without

    return ranges.find(config.env, config.randomise)


@dataclass(frozen=True, slots=True)
class Lanes:
    """Trains, plays and scores the lanes that the store lacks, and stores what comes."""

    config: RunConfig
    store: Store
    trainer: Trainer
    tell: Tell
    ranks: Ranks = "played"
    """What ranks them: where it is "training", none plays."""
    peaks: tuple[Peak, ...] = PEAKS
    """Which policies of a lane may stand for it: that which plays best, or the first where none plays."""

    def train(self, wanted: Iterable[Wanted], *, steps: int = 0) -> dict[str, TrainingResult]:
        """Results of all these lanes, by id; those that the store holds are not trained again.

        Args:
            steps: environment steps of each; 0 for those of the settings.

        Raises:
            WorkerError: when no lane at all could be trained, nor the task's own reward: the machine's fault, not a
                reward's. A lane that ends its worker by itself has a result that says so.
        """
        lanes = dict(wanted)
        self.store.lanes.add(lanes)
        sharing = self._shared(lanes)
        going = {lane: group[0] for lane, group in sharing.items()}
        raced = self.store.history().lanes  # a program that comes again does not race again
        rivals = frozenset(lane.id for lane in lanes if lane.role == "candidate").difference(raced)
        ladder = Ladder(self.store.lanes, rivals, self.config.cost_limits, self._of_the_moment)
        whole = self._budget(steps)
        for number, rung in enumerate((*RUNGS[self.config.schedule], WHOLE), start=1):
            due, failed = ladder.due(number, rung, going), list[TrainingResult]()
            budget = dataclasses.replace(whole, until=rung.share)
            for group in _alike(due):
                hear = partial(self._hear, number=number, sharing=sharing, failed=failed)
                events, event = self.trainer.train(self.config.env, group, budget), None
                try:
                    for event in events:
                        hear(event)
                except KeyboardInterrupt as stop:
                    self._hear_out(events, event, hear, stop)
                    raise
                finally:
                    if isinstance(events, Generator):
                        events.close()  # an error that somebody keeps would keep it, and its workers, at work
            # Beside generated rewards alone the trainer has tried the human one.
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
        """Whether any of them left a policy, perhaps before the run was stopped: the machine can train."""
        results = self.store.lanes.results()
        known = (results[lane.id] for lane in lanes if lane.id in results)
        return any(result.state is not TrainingState.FAILED for result in known)

    def _shared(self, lanes: Mapping[Lane, RewardProgram]) -> dict[str, list[LaneSpec]]:
        """The lanes without a result, by the one of them that trains for all that would train alike: programs that
        differ only in comments or local names have equal graphs."""
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
        """Keep the results that had come when Ctrl-C fell between two of them, or while the last was being kept."""
        if isinstance(last, TrainingResult) and last.lane not in self.store.lanes.results():
            hear(last)
        if isinstance(events, Generator):
            with suppress(StopIteration):
                hear(events.throw(stop))
                for late in events:
                    hear(late)

    def _hear(self, event: TrainingEvent, number: int, sharing: Sharing, failed: list[TrainingResult]) -> None:
        """Keep what comes of a lane on the way to a rung; those that failed are for the caller to judge together."""
        if isinstance(event, TrainingProgress):
            self.tell(event)
        elif event.state is TrainingState.PAUSED:
            self.store.lanes.pause(number, event)
        elif event.state is TrainingState.FAILED:
            failed.append(event)
        else:
            self._keep(event, sharing[event.lane])

    def _budget(self, steps: int) -> TrainBudget:
        """What each lane trains with, as long as nothing cuts it."""
        return TrainBudget(
            env_steps=steps or self.config.steps,
            worlds=self.config.worlds,
            bonus=cast("Bonus", self.config.bonus),
            randomise=drawn(self.config),
            observe=cast("Observe", self.config.observe),
        )

    def _spec(self, lane: Lane, program: RewardProgram) -> LaneSpec:
        ranges = self.store.lanes.ranges()[lane.ranges] if lane.ranges else None
        spec = LaneSpec(id=lane.id, program=program, seed=lane.seed, randomise=ranges)
        if lane.start is None:
            return spec
        log, policy = self.store.lanes, lane.start.policy
        rescaled = log.all()[policy.lane].reward != lane.reward
        return dataclasses.replace(spec, start=log.policy(*policy), fresh=lane.start.fresh, rescaled=rescaled)

    def _of_the_moment(self, paused: Mapping[str, TrainingResult]) -> dict[str, Evaluation]:
        """What the newest policies of lanes under way score, on start states for choosing."""
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
        """What each lane scores by the one of its policies that plays best, on start states kept for choosing; nothing
        where training ranks.

        All play some episodes; those candidates that are level with the best of them within the errors of both play
        some more. All of it takes at most about a tenth of the steps of training.
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
        """What each lane scored when it played first. Whether it has played again depends on when a run was stopped, so
        what a resumed run decides anew rests on this."""
        return self._scores(ids, looks=1)

    def scores(self) -> dict[str, Evaluation]:
        """What every lane that has played scored, in all looks."""
        return self._scores(self.store.lanes.plays())

    def _scores(self, ids: Iterable[str], looks: int | None = None) -> dict[str, Evaluation]:
        plays, limits = self.store.lanes.plays(), self.config.cost_limits
        return {
            lane: played({peak: own[:looks] for peak, own in plays[lane].items()}, limits)
            for lane in ids
            if lane in plays
        }

    def _look(self, look: int, ids: Sequence[str]) -> None:
        """Let those play that have not yet, in this look, side by side on the same start states."""
        known, results, records = self.store.lanes.plays(), self.store.lanes.results(), self.store.lanes.all()
        # Whose F is undefined wins nothing, unless it was cut while F waited, or went on from a policy for too short.
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
        self.store.lanes.save_plays(look, scores)  # all or none: who plays beside whom may matter to the last bit

    def _evidence(self, looks: Iterable[Tryout]) -> frozenset[str]:
        """By which of these a later screen may judge: the first policy of each lane of the search."""
        roles, firsts = self.store.lanes.all(), dict[str, str]()
        for one in looks:
            if roles[one.lane].role in ("candidate", "baseline"):
                firsts.setdefault(one.lane, _key(one))
        return frozenset(firsts.values())

    def counted_peaks(self, ids: Iterable[str]) -> dict[str, Peak]:
        """Which of its policies counts for each lane: that which plays best, or the first where none was played."""
        plays = self.store.lanes.plays()
        limits = self.config.cost_limits
        return {lane: counted_peak(plays.get(lane), self.peaks[0], limits) for lane in ids}

    def keep(self, best: Scored | None, lane: str | None = None) -> None:
        """Leave a reward, if any, in `best/`, with the policy of a lane; None for its lane in the search."""
        if best is None:  # who led may be rejected by now
            return self.store.folders.clear("best")
        lane = lane or lane_id(best.candidate_id, self.config.seed)
        self.store.save_best(best.sample.candidate, PolicyId(lane, self.counted_peaks([lane])[lane]))

    def evaluate(self, ids: Mapping[str, Peak]) -> dict[str, Evaluation]:
        """Held-out scores by lane id, each of the named policy; a lane without it has none."""
        known = self.store.lanes.evaluations()
        missing = (Tryout(lane=lane, name="", peak=peak) for lane, peak in ids.items() if lane not in known)
        self.store.lanes.save_evaluations([score for _, score in self._play(missing, HELD_OUT)])
        return {lane: score for lane, score in self.store.lanes.evaluations().items() if lane in ids}

    def try_out(self, tryouts: Iterable[Tryout], *, starts: int = HELD_OUT, episodes: int = 0) -> None:
        """Take the scores that the store does not hold yet.

        Args:
            starts: whether on the start states of `evaluate`, those for choosing, for comparing, or of robust policies.
            episodes: of each tryout; 0 for as many as a final score needs.
        """
        known = self.store.lanes.tryouts()
        missing = (tryout for tryout in tryouts if tryout.name not in known.get(tryout.lane, {}))
        for tryout, score in self._play(missing, starts, episodes):
            self.store.lanes.save_tryout(tryout.name, score)

    def _play(
        self, tryouts: Iterable[Tryout], starts: int, episodes: int = 0, record: Collection[str] = ()
    ) -> Iterator[tuple[Tryout, Evaluation]]:
        """What these score side by side, on the same start states; one whose policy is not kept scores nothing."""
        asked = {_key(tryout): tryout for tryout in tryouts}
        policies = {key: self.store.lanes.policy(tryout.lane, tryout.peak) for key, tryout in asked.items()}
        playing = {key: policy for key, policy in policies.items() if policy is not None}
        if not playing:
            return
        records = self.store.lanes.all()
        # Without `screen=` a trainer of somebody's own need not know the word.
        play = partial(self.trainer.evaluate, record=record) if record else self.trainer.evaluate
        for score in play(
            self.config.env,
            playing,
            seed=self.config.seed + starts,
            episodes=episodes,
            dynamics={key: asked[key].dynamics for key in playing},
            untrained={key: records[asked[key].lane].seed for key in playing if asked[key].untrained},
        ):
            tryout = asked[score.lane]
            peak = None if tryout.untrained else tryout.peak
            yield tryout, dataclasses.replace(score, lane=tryout.lane, peak=peak)


def _key(tryout: Tryout) -> str:
    """What the trainer knows it by."""
    return f"{tryout.lane} {tryout.name}".rstrip()


def _alike(due: Sequence[LaneSpec]) -> list[list[LaneSpec]]:
    """Lanes that go on, and those that begin anew as what they were at a rung is lost: no population trains both."""
    groups = [[spec for spec in due if (spec.paused is None) == anew] for anew in (False, True)]
    return [group for group in groups if group]
