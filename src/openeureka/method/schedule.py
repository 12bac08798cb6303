"""How long candidates train: all to the end, or fewer and fewer, by how their policies play on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ..score import worth
from ..store.lane_log import LaneLog
from ..types import Evaluation, LaneSpec, Limits, Standing, TrainingResult, TrainingState

Going = Mapping[str, LaneSpec]
"""Lanes that go on training, by id."""


@dataclass(frozen=True, slots=True)
class Rung:
    """A point of the training at which the candidates of a generation pause, and only some of them go on."""

    share: float
    """Share of a training's steps after which they pause."""
    kept: float
    """Share of the candidates at this rung that go on; at least one does."""


WHOLE = Rung(share=1.0, kept=1.0)
"""The end of a training."""
RUNGS: Mapping[str, tuple[Rung, ...]] = {
    "full": (),
    "quarter": (Rung(1 / 4, 1 / 4),),
    "halving": (Rung(1 / 8, 1 / 2), Rung(1 / 4, 1 / 2), Rung(1 / 2, 1 / 2)),
}
"""Rungs by the setting `schedule`."""


def leaders(scores: Mapping[str, Evaluation], rung: Rung, limits: Limits) -> frozenset[str]:
    """Lanes that go on: those that play best, the earlier of equals. Lanes that break a limit rank below the others."""
    ordered = sorted(scores, key=lambda lane: worth(scores[lane], limits), reverse=True)
    return frozenset(ordered[: max(1, math.ceil(rung.kept * len(ordered)))])


def why(rung: Rung, lane: str, scores: Mapping[str, Evaluation], limits: Limits) -> str:
    """Why a lane was cut, for people."""
    own = worth(scores[lane], limits)
    place = sum(worth(score, limits) > own for score in scores.values()) + 1
    return f"after {rung.share:.3g} of its steps, at place {place} of {len(scores)}"


@dataclass(frozen=True, slots=True)
class Ladder:
    """Takes lanes from rung to rung; what was decided before a run was stopped is read from the log."""

    log: LaneLog
    rivals: frozenset[str]
    """The lanes that are compared with each other, and may be cut."""
    limits: Limits
    play: Callable[[Mapping[str, TrainingResult]], Mapping[str, Evaluation]]
    """Scores the newest policies of paused lanes."""

    def due(self, number: int, rung: Rung, going: Going) -> list[LaneSpec]:
        """Lanes that have to train to a rung, or to the end. None stops at a rung where fewer than two compete."""
        if rung is WHOLE:
            return list(going.values())
        if self._stood(number, going) or not self._entered(number, going):
            return []
        return [spec for lane, spec in going.items() if self.log.paused(number, lane) is None]

    def climb(self, number: int, rung: Rung, going: Going) -> tuple[dict[str, LaneSpec], list[TrainingResult]]:
        """Let policies play at a rung. Gives the lanes that go on, and the results of the rivals that are cut."""
        stood = self._stood(number, going)
        if not stood and (rung is WHOLE or not self._entered(number, going)):
            return dict(going), []
        paused = {lane: result for lane in going if (result := self.log.paused(number, lane)) is not None}
        if not stood:
            stood = self._decide(rung, paused)
            self.log.save_rung(number, stood.values())
        # If the run was killed between two cuts, some lanes that raced have a result already, and are not in `going`.
        known = self.log.rungs().items()
        racing = {lane: at[number].played for lane, at in known if lane in self.rivals and number in at}
        on, cut = dict[str, LaneSpec](), list[TrainingResult]()
        for lane in stood:
            result = paused.get(lane)
            if result is None or stood[lane].went_on:  # a lane whose paused state is lost begins anew
                on[lane] = replace(going[lane], paused=result.paused if result is not None else None)
            else:
                said = why(rung, lane, racing, self.limits)
                cut.append(replace(result, state=TrainingState.CUT, message=said))
        return on, cut

    def _entered(self, number: int, going: Going) -> bool:
        """Whether lanes stop at a rung: rivals race to it, or did so before the run was stopped, and then all but one
        of them diverged on the way."""
        racing = sum(lane in self.rivals for lane in going) > 1
        return racing or any(self.log.paused(number, lane) is not None for lane in going)

    def _stood(self, number: int, going: Going) -> dict[str, Standing]:
        """How each lane stood at a rung; empty until that is decided."""
        return {lane: at[number] for lane, at in self.log.rungs().items() if lane in going and number in at}

    def _decide(self, rung: Rung, paused: Mapping[str, TrainingResult]) -> dict[str, Standing]:
        """Scores of the lanes' policies at this moment, and which lanes go on."""
        scores = self.play(paused)
        cut = {lane for lane in scores if lane in self.rivals}
        cut -= leaders({lane: scores[lane] for lane in paused if lane in cut}, rung, self.limits)
        return {lane: Standing(replace(scores[lane], peak="last"), lane not in cut) for lane in scores}
