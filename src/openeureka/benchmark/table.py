"""Finished cells compared: by task, over tasks, and as a figure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from ..config import short_name
from ..numbers import dollars, duration, number
from ..report import charts
from ..report.tables import Table
from ..score import clipped, human_normalised
from ..stats import Estimate, estimate, mean
from .figures import Result
from .plan import Plan

Key = TypeVar("Key")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One arm on one task, over its finished seeds. Numbers are None where no seed has them."""

    task: str
    arm: str
    seeds: int
    """Number of finished seeds."""
    search_steps: float | None
    """Environment steps of the candidates, mean over seeds."""
    steps: float | None
    """The same for all trainings, including those of the human and the sparse reward and the final ones."""
    matched: Estimate | None
    """The best played F when the search had spent as many steps as the cheapest arm with the same seed."""
    held_out: Estimate | None
    """Held-out F of the best reward, over fresh trainings."""
    score: float | None
    """The human-normalised score of that F, clipped to [0, 3]. It has no interval: all seeds share the scale."""
    difference: Estimate | None
    """Difference of held-out F to the first arm's, paired by seed; None for the first arm itself."""
    cost_usd: float
    """Cost of the replies of all seeds."""
    minutes: float
    """Minutes of training, all seeds; of lanes that train side by side, only the longest counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Total:
    """One arm over all tasks."""

    arm: str
    cells: int
    """Number of finished cells."""
    score: float | None
    """Human-normalised score, clipped to [0, 3]; every task and seed counts alike. No interval, as in `Row`."""
    scored: int
    """Cells that have a score."""
    difference: Estimate | None
    """Difference of the score to the first arm's, paired by task and seed; None for the first arm itself."""
    cost_usd: float
    minutes: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """The finished cells of a plan. The other arms are compared with the first."""

    plan: Plan
    results: tuple[Result, ...]

    @property
    def rows(self) -> tuple[Row, ...]:
        """A row for each task and arm, in the order of the plan."""
        return tuple(self._row(task, arm) for task in self.plan.tasks for arm in self.plan.arms)

    @property
    def totals(self) -> tuple[Total, ...]:
        """A row for each arm."""
        return tuple(map(self._total, self.plan.arms))

    def _row(self, task: str, arm: str) -> Row:
        own = self._of(task, arm)
        held_out = {seed: result.held_out for seed, result in own.items()}
        return Row(
            task=task,
            arm=arm,
            seeds=len(own),
            search_steps=mean([result.search_steps for result in own.values()]),
            steps=mean([result.steps for result in own.values()]),
            matched=estimate([result.reached(self._cheapest(task, seed)) for seed, result in own.items()]),
            held_out=estimate([*held_out.values()]),
            score=mean([self._score(result) for result in own.values()]),
            difference=self._difference(
                arm, held_out, {seed: result.held_out for seed, result in self._of(task, self._first).items()}
            ),
            cost_usd=sum(result.cost_usd for result in own.values()),
            minutes=sum(result.minutes for result in own.values()),
        )

    def _total(self, arm: str) -> Total:
        own = [result for result in self.results if result.arm == arm]
        scores, first = self._scores(arm), self._scores(self._first)
        return Total(
            arm=arm,
            cells=len(own),
            score=mean([*scores.values()]),
            scored=sum(score is not None for score in scores.values()),
            difference=self._difference(arm, scores, first),
            cost_usd=sum(result.cost_usd for result in own),
            minutes=sum(result.minutes for result in own),
        )

    @property
    def _first(self) -> str:
        return next(iter(self.plan.arms))

    def _of(self, task: str, arm: str) -> dict[int, Result]:
        """The results of an arm on a task, by seed."""
        return {result.seed: result for result in self.results if (result.task, result.arm) == (task, arm)}

    def _scores(self, arm: str) -> dict[tuple[str, int], float | None]:
        return {(result.task, result.seed): self._score(result) for result in self.results if result.arm == arm}

    def _score(self, result: Result) -> float | None:
        """Score on one scale for all arms of a task: a single cell says little of the task's own rewards."""
        return clipped(human_normalised(result.held_out, *self.scale(result.task)))

    def scale(self, task: str) -> tuple[float | None, float | None]:
        """Held-out F of the task's human and sparse reward, mean over all its cells."""
        cells = [result for result in self.results if result.task == task]
        return mean([cell.human for cell in cells]), mean([cell.sparse for cell in cells])

    def _cheapest(self, task: str, seed: int) -> int:
        """Steps of the search that took the fewest, among those that trained at all."""
        cells = (result for result in self.results if (result.task, result.seed) == (task, seed))
        return min((cell.search_steps for cell in cells if cell.search_steps), default=0)

    def _difference(
        self, arm: str, own: Mapping[Key, float | None], first: Mapping[Key, float | None]
    ) -> Estimate | None:
        if arm == self._first:
            return None
        pairs = ((own[key], first[key]) for key in own if key in first)
        return estimate([a - b for a, b in pairs if a is not None and b is not None], claims=len(self.plan.arms) - 1)

    # --- for people --------------------------------------------------------------------------------------------------

    def tables(self) -> tuple[Table, Table]:
        """The table by task, and the one over tasks."""
        to_first = f"more than {self._first}"
        titles = (
            "task", "arm", "seeds", "steps of the search", "steps in all", "F played, matched steps", "F held out",
            "score", to_first, "", "cost, US$", "training",
        )  # fmt: skip
        by_task = Table(titles, [*map(_cells, self.rows)], self._note())
        titles = ("arm", "cells", "score", to_first, "", "cost, US$", "training")
        over_tasks = Table(titles, [*map(_total_cells, self.totals)], "Over all tasks and seeds.")
        return by_task.filled, over_tasks.filled

    def _note(self) -> str:
        claims = len(self.plan.arms) - 1
        together = f", which hold for all {claims} arms together" if claims > 1 else ""
        paired = f" Differences are paired by seed{together}." if claims else ""
        scored = {result.arm for result in self.results if result.held_out is not None}
        if scored and self._first not in scored:
            paired = f" Nothing is compared, because the first arm, {self._first}, has no F held out."
        return (
            "Means over seeds and 95 % intervals, one value per search. F held out: of the best reward in fresh "
            "trainings and episodes. Score: 0 is as good as the sparse reward, 1 as the human one, or -1 where that is "
            "below the sparse one; clipped to 0 and 3. It has no "
            "interval, because all searches share its scale. F played, matched steps: the best of the search when it "
            f"had used as many steps as the cheapest arm.{paired}"
        )

    def figures(self) -> Iterator[charts.Chart]:
        """A chart per task: best played F against steps of the search, mean over seeds, and the human reward's F."""
        for task in self.plan.tasks:
            lines = {arm: _mean_curve([*self._of(task, arm).values()]) for arm in self.plan.arms}
            human, _ = self.scale(task)
            levels = {"human reward, held out": human} if human is not None else {}
            chart = charts.spending(f"{short_name(task)}: best played F so far, mean over seeds", lines, levels)
            if chart is not None:
                yield chart


def _mean_curve(results: Sequence[Result]) -> list[charts.Point]:
    """The curve begins where every search has played something; a search that has ended keeps its last value."""
    changes = sorted({steps for result in results for steps, _ in result.curve})
    found: list[charts.Point] = []
    for steps in changes:
        values = [result.reached(steps) for result in results]
        if None not in values and (average := mean(values)) is not None:
            found.append((float(steps), average))
    return found


def _cells(row: Row) -> tuple[str, ...]:
    return (
        short_name(row.task),
        row.arm,
        str(row.seeds),
        *(f"{steps:,.0f}" if steps is not None else "-" for steps in (row.search_steps, row.steps)),
        _with_missing(row.matched, row.seeds),
        _with_missing(row.held_out, row.seeds),
        number(row.score),
        *_decided(row.difference),
        *_spent(row),
    )


def _total_cells(row: Total) -> tuple[str, ...]:
    score = _missing(number(row.score), row.cells - row.scored)
    return (row.arm, str(row.cells), score, *_decided(row.difference), *_spent(row))


def _spent(row: Row | Total) -> Iterable[str]:
    return dollars(row.cost_usd), duration(60 * row.minutes)


def _with_missing(found: Estimate | None, count: int) -> str:
    return _missing(shown(found), count - (found.count if found is not None else 0))


def _missing(value: str, missing: int) -> str:
    """Adds how many searches have no value, since a mean leaves them out."""
    return f"{value} ({missing} undefined)" if missing else value


def _decided(difference: Estimate | None) -> tuple[str, str]:
    if difference is None:
        return "", ""
    return shown(difference, sign="+"), "decided" if difference.sure else "not decided"


def shown(found: Estimate | None, sign: str = "") -> str:
    """`412 (390 to 434)`; only the value where there is no interval."""
    if found is None:
        return number(None)
    ends = f" ({found.low:{sign}.3g} to {found.high:{sign}.3g})" if found.low is not None else ""
    return f"{found.value:{sign}.4g}{ends}"
