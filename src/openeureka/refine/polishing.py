"""Carries the best policy of a search on: lanes go on from it, each in its own way, the best is judged as it is, and
both are compared.

What that policy scores is no measure of the reward it was trained under last: from a good policy, poor rewards do well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ..config import RunConfig
from ..events import Began
from ..method.lanes import COMPARING, Lanes
from ..method.seeds import Wanted, polish_seeds
from ..score import breach, gain, worth
from ..stats import Estimate
from ..store import Store
from ..types import PEAKS, Evaluation, Lane, Limits, PolicyId, RewardGraph, Start, TrainingResult, Tryout

SHARES = (0.0, 0.1, 0.25, 0.5)
"""Of fresh weights in the mixture that a lane begins with."""
COMPARED = "carried on"
"""What the tryout of both policies is called."""
PARTS = 8
"""Of a training's steps; a lane takes one of them where the settings do not say."""


def polish(lanes: Lanes) -> None:
    """Train lanes from the policy in `best/`, under its own reward and the others that trained again in the end; let
    them play, and judge the one that plays best beside that policy, both in new episodes: by its final score that one
    was chosen among its seeds. If the other is better, `polished/` holds it.

    Raises:
        EurekaError: what stopped it; all that was finished is stored, and calling again continues.
    """
    lanes = replace(lanes, ranks="played", peaks=PEAKS)  # whatever the search ranks by
    config, store, log, tell = lanes.config, lanes.store, lanes.store.lanes, lanes.tell
    starts = (lane.start.policy for lane in log.all().values() if lane.role == "polish" and lane.start is not None)
    began = next(starts, None) or store.best()
    if began is None or log.best_policy() is not None:
        return
    steps = config.polish_steps or max(1, log.results()[began.lane].env_steps // PARTS)
    tell(Began("polish"))
    results = lanes.train(deal(config, began, rewards(store, log.all()[began.lane].reward)), steps=steps)
    tell(Began("play"))
    leader = _leader(lanes.play(results), config.cost_limits)
    tell(Began("evaluate"))
    both = [policy for policy in (began, leader) if policy is not None]
    lanes.try_out([Tryout(lane=lane, name=COMPARED, peak=peak) for lane, peak in both], starts=COMPARING)
    scores = _compared(log.tryouts())
    better = max((began.lane, *results), key=lambda lane: worth(scores.get(lane), config.cost_limits))
    best = PolicyId(better, scores[better].peak or began.peak) if better != began.lane else began
    if best != began:
        store.folders.fill("polished", best)
    log.save_best_policy(best)


def deal(config: RunConfig, began: PolicyId, rewards: Mapping[str, RewardGraph]) -> list[Wanted]:
    """`config.polish` lanes, each of another reward or with another share of fresh weights: those first that change
    least. With more lanes than there are such pairs, they come again with further seeds.

    Args:
        rewards: by name, the policy's own first.
    """
    pairs = [(order, name, share) for order, name in enumerate(rewards) for share in range(len(SHARES))]
    pairs.sort(key=lambda pair: (pair[0] + pair[2], pair[0]))
    found: list[Wanted] = []
    for number, seed in enumerate(polish_seeds(config)):
        _, name, share = pairs[number % len(pairs)]
        found.append((Lane(name, seed, "polish", Start(began, SHARES[share])), rewards[name]))
    return found


def rewards(store: Store, own: str) -> dict[str, RewardGraph]:
    """One reward, then the others that trained with fresh seeds: the contenders for the crown, and fitted ones."""
    final = [lane.reward for lane in store.lanes.all().values() if lane.role == "final"]
    programs = {name: store.rewards.program(name) for name in (own, *final)}
    return {name: program for name, program in programs.items() if isinstance(program, RewardGraph)}


def _compared(tryouts: Mapping[str, Mapping[str, Evaluation]]) -> dict[str, Evaluation]:
    """What policies scored when they were compared, by lane id."""
    return {lane: own[COMPARED] for lane, own in tryouts.items() if COMPARED in own}


def _leader(played: Mapping[str, Evaluation], limits: Limits) -> PolicyId | None:
    """The policy that plays best, of those that keep the limits if any does; of equals that of the first lane."""
    lane = max(played, key=lambda lane: worth(played[lane], limits), default=None)
    peak = played[lane].peak if lane is not None else None
    return PolicyId(lane, peak) if lane is not None and peak is not None else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Try:
    """One lane that carried the policy on, as far as it has come."""

    lane: Lane
    start: Start
    result: TrainingResult | None
    """None while it trains."""
    played: Evaluation | None
    """What the best of its policies scored when they were played to choose by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Polished:
    """A policy and what came of carrying it on. Both are judged as they are: it says nothing of any reward."""

    tries: tuple[Try, ...]
    began: PolicyId
    """The policy of the best reward, from which all of them went on."""
    before: Evaluation | None
    """Its F, held out; None before it is judged."""
    chosen: Try | None
    """The lane whose policy plays best; None before that is judged, and where none left one."""
    after: Evaluation | None
    """F of that policy, held out."""
    best: PolicyId | None
    """The one of both with the higher F, held out, of those that keep the limits; None before they are judged."""
    breach: str = ""
    """The limits that the chosen lane's policy breaks, held out; empty where none."""
    breach_before: str = ""
    """Those that the policy which it began from breaks."""

    @property
    def better(self) -> bool:
        """Whether carrying on led to a policy of higher F, held out, which stands in `polished/`."""
        return self.best is not None and self.best != self.began

    @property
    def gain(self) -> Estimate | None:
        """F after less that before, with an interval over episodes."""
        return gain(self.after, self.before) if self.after is not None and self.before is not None else None


def read(
    lanes: Mapping[str, Lane],
    results: Mapping[str, TrainingResult],
    played: Mapping[str, Evaluation],
    tryouts: Mapping[str, Mapping[str, Evaluation]],
    best: PolicyId | None,
    limits: Limits,
) -> Polished | None:
    """What the store of a run says of it; None where no policy was carried on.

    Args:
        lanes: by id, as all that follows.
        played: what lanes scored when they were played to choose by.
        tryouts: what they were tried in, by name.
        best: `LaneLog.best_policy`.
        limits: of the run.
    """
    tries = [
        Try(lane=lane, start=lane.start, result=results.get(name), played=played.get(name))
        for name, lane in lanes.items()
        if lane.role == "polish" and lane.start is not None
    ]
    if not tries:
        return None
    began, scores = tries[0].start.policy, _compared(tryouts)
    chosen = next((one for one in tries if one.lane.id in scores), None)
    return Polished(
        tries=tuple(tries),
        began=began,
        before=scores.get(began.lane),
        chosen=chosen,
        after=scores[chosen.lane.id] if chosen is not None else None,
        breach=breach(scores[chosen.lane.id], limits) if chosen is not None else "",
        breach_before=breach(scores.get(began.lane), limits),
        best=best,
    )
