"""What carrying the best policy on has found: all that tried, and the best of them beside what they began from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..score import Estimate, breach, gain
from ..types import Evaluation, Lane, Limits, PolicyId, Start, TrainingResult


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
    evaluations: Mapping[str, Evaluation],
    best: PolicyId | None,
    limits: Limits,
) -> Polished | None:
    """What the store of a run says of it; None where no policy was carried on.

    Args:
        lanes: by id, as all that follows.
        played: what lanes scored when they were played to choose by.
        evaluations: what they scored in held-out episodes.
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
    began = tries[0].start.policy
    chosen = next((one for one in tries if one.lane.id in evaluations), None)
    return Polished(
        tries=tuple(tries),
        began=began,
        before=evaluations.get(began.lane),
        chosen=chosen,
        after=evaluations[chosen.lane.id] if chosen is not None else None,
        breach=breach(evaluations[chosen.lane.id], limits) if chosen is not None else "",
        best=best,
    )
