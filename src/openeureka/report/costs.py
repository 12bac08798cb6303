"""What policies cost besides F, and which limits they break."""

from __future__ import annotations

from collections.abc import Container

from ..numbers import number, scored
from ..types import COSTS, OWN_REWARDS, Evaluation, lane_id
from .tables import Table
from .view import RunView


def table(run: RunView, shown: Container[str] = COSTS) -> Table:
    """A row for each policy that was played, candidates before baselines; no rows where none of the costs to show was
    measured."""
    scores = _scores(run)
    limits = run.config.cost_limits
    names = [name for name in COSTS if name in shown and any(name in score.costs for score in scores.values())]
    rows = [
        (
            called,
            scored(score),
            *(
                f"{number(score.costs.get(name), 3)}{' BROKEN' if name in score.broken(limits) else ''}"
                for name in names
            ),
        )
        for called, score in scores.items()
    ]
    titles = ("costs when played", "F", *(_title(name, limits.get(name)) for name in names))
    note = "; ".join(f"{name}: {COSTS[name].meaning}" for name in names)
    return Table(titles, rows if names else [], f"{note}." if note else "")


def facts(score: Evaluation | None) -> Table:
    """A row for each cost of one policy."""
    known = [(name, value) for name, value in score.costs.items() if name in COSTS] if score is not None else []
    return Table(("", ""), [(f"{name} [{COSTS[name].unit}]", number(value, 3)) for name, value in known])


def _scores(run: RunView) -> dict[str, Evaluation]:
    if not run.searched:
        lanes = {name: name for name, lane in run.lanes.items() if lane.role == "given"}
    else:
        lanes = {str(c.place): c.result.lane for c in run.candidates if c.result is not None}
        lanes |= {f"{name} reward": lane_id(name, run.config.seed) for name in OWN_REWARDS}
    return {called: score for called, lane in lanes.items() if (score := run.played.get(lane)) and score.costs}


def _title(name: str, limit: float | None) -> str:
    most = f", at most {limit:g}" if limit is not None else ""
    return f"{name} [{COSTS[name].unit}]{most}"
