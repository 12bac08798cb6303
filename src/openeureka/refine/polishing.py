"""Trains the best policy of a search further: lanes go on from it in different ways, and the best result is compared
with the policy that they began from.

The score of such a policy says nothing about the reward of its last training: from a good policy, poor rewards do well.
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
"""Shares of fresh weights in the mixtures that lanes begin with."""
COMPARED = "carried on"
"""Name of the tryouts of both policies."""
PARTS = 8
"""Parts of a training's steps; by default, a lane trains for one of them."""


def polish(lanes: Lanes) -> None:
    """Train lanes from the policy in `best/`, under its own reward and the others that trained again in the end. Let
    them play, and compare the policy that plays best with the one in `best/`. Both play new episodes: the final score
    of the latter is too high, as it was chosen among seeds by that. If the other is better, `polished/` holds it.

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
    """`config.polish` lanes, one for each pair of a reward and a share of fresh weights, pairs that change least first.
    If there are more lanes than pairs, the pairs come again with further seeds.

    Args:
        rewards: programs by name, the policy's own reward first.
    """
    pairs = [(order, name, share) for order, name in enumerate(rewards) for share in range(len(SHARES))]
    pairs.sort(key=lambda pair: (pair[0] + pair[2], pair[0]))
    found: list[Wanted] = []
    for number, seed in enumerate(polish_seeds(config)):
        _, name, share = pairs[number % len(pairs)]
        found.append((Lane(name, seed, "polish", Start(began, SHARES[share])), rewards[name]))
    return found


def rewards(store: Store, own: str) -> dict[str, RewardGraph]:
    """The named reward, then the others that trained with fresh seeds: contenders for the crown, and fitted ones."""
    final = [lane.reward for lane in store.lanes.all().values() if lane.role == "final"]
    programs = {name: store.rewards.program(name) for name in (own, *final)}
    return {name: program for name, program in programs.items() if isinstance(program, RewardGraph)}


def _compared(tryouts: Mapping[str, Mapping[str, Evaluation]]) -> dict[str, Evaluation]:
    """Scores of policies in the comparison, by lane id."""
    return {lane: own[COMPARED] for lane, own in tryouts.items() if COMPARED in own}


def _leader(played: Mapping[str, Evaluation], limits: Limits) -> PolicyId | None:
    """The policy that plays best, of those that keep the limits if any does; the first lane's of equals."""
    lane = max(played, key=lambda lane: worth(played[lane], limits), default=None)
    peak = played[lane].peak if lane is not None else None
    return PolicyId(lane, peak) if lane is not None and peak is not None else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Try:
    """One lane that trained the policy further, as far as it has come."""

    lane: Lane
    start: Start
    result: TrainingResult | None
    """None while it trains."""
    played: Evaluation | None
    """Score of the best of its policies, when they were played to choose by."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Polished:
    """A policy and what came of training it further. The scores compare policies and say nothing about rewards."""

    tries: tuple[Try, ...]
    began: PolicyId
    """The policy of the best reward, from which all lanes went on."""
    before: Evaluation | None
    """Held-out score of that policy; None before it is judged."""
    chosen: Try | None
    """The lane whose policy plays best; None before that is judged, and where no lane left a policy."""
    after: Evaluation | None
    """Held-out score of the chosen lane's policy."""
    best: PolicyId | None
    """The one of the two with the higher held-out F, of those that keep the limits; None before they are judged."""
    breach: str = ""
    """The limits that the chosen lane's policy breaks, held out; empty where it breaks none."""
    breach_before: str = ""
    """The same for the policy that it began from."""

    @property
    def better(self) -> bool:
        """Whether training further led to a policy of higher held-out F, which is in `polished/`."""
        return self.best is not None and self.best != self.began

    @property
    def gain(self) -> Estimate | None:
        """Held-out F after training further minus that before, with an interval over episodes."""
        return gain(self.after, self.before) if self.after is not None and self.before is not None else None


def read(
    lanes: Mapping[str, Lane],
    results: Mapping[str, TrainingResult],
    played: Mapping[str, Evaluation],
    tryouts: Mapping[str, Mapping[str, Evaluation]],
    best: PolicyId | None,
    limits: Limits,
) -> Polished | None:
    """What the store of a run says of polishing; None where no policy was trained further.

    Args:
        lanes: lanes by id; all that follows is by lane id too.
        played: scores of lanes when they were played to choose by.
        tryouts: scores of lanes in tryouts, by the tryout's name.
        best: `LaneLog.best_policy`.
        limits: limits of the run.
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
    after = scores[chosen.lane.id] if chosen is not None else None
    return Polished(
        tries=tuple(tries),
        began=began,
        before=scores.get(began.lane),
        chosen=chosen,
        after=after,
        breach=breach(after, limits),
        breach_before=breach(scores.get(began.lane), limits),
        best=best,
    )
