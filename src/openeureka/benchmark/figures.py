"""One finished cell in numbers, all of them from its run directory."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from ..method import race
from ..method.seeds import final_seeds, polish_seeds, tuning_seeds
from ..refine import tuned
from ..report.view import RunView
from ..score import rank
from ..stats import mean
from ..store import has_begun, look
from ..types import Role, lane_id
from .plan import Cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What one search spent and found."""

    task: str
    arm: str
    seed: int
    search_steps: int
    """Environment steps of the trainings of its candidates."""
    steps: int
    """Environment steps of all its trainings, including those of the human and the sparse reward and the final ones."""
    held_out: float | None
    """Held-out F of its best reward, mean over fresh trainings; None where none left a policy."""
    human: float | None
    sparse: float | None
    """The same for the rewards that come with the task."""
    cost_usd: float
    """Cost of its replies."""
    minutes: float
    """Minutes of training; of lanes that train side by side, only the longest counts."""
    curve: tuple[tuple[int, float], ...]
    """The best played F so far, where it rose: steps spent until then, and F."""

    @property
    def name(self) -> str:
        """Name of the directory of its search."""
        return Cell(self.task, self.arm, self.seed).name

    def reached(self, steps: int) -> float | None:
        """The best played F when the search had spent so many steps."""
        return max((value for spent, value in self.curve if spent <= steps), default=None)


def read(cell: Cell, directory: Path) -> Result | None:
    """The numbers of a cell; None where its search is not over. Raises StoreError where its run cannot be read."""
    if not has_begun(directory) or not look(directory)[1].ended:
        return None
    run = RunView.read(directory)
    outcome = run.outcome
    slots = list(run.history.spent())
    spent = list(accumulate(steps for _, steps in slots))
    search_steps = spent[-1] if spent else 0
    others = [result for lane, result in run.results.items() if run.lanes[lane].role != "candidate"]
    return Result(
        task=cell.task,
        arm=cell.arm,
        seed=cell.seed,
        search_steps=search_steps,
        steps=search_steps + sum(result.env_steps for result in others),
        held_out=mean(_handed_over(run)),
        human=mean(outcome.human.held_out) if outcome is not None else None,
        sparse=mean(outcome.sparse.held_out) if outcome is not None else None,
        cost_usd=run.usage.cost_usd,
        minutes=_seconds(run) / 60,
        curve=_rises(
            (steps, slot.played.fitness)
            for steps, (slot, _) in zip(spent, slots, strict=True)
            if slot.played is not None and not slot.breaks(run.config.cost_limits)
        ),
    )


def _handed_over(run: RunView) -> Sequence[float | None]:
    """Held-out F of the reward in `best/`, a value per seed: with its fitted numbers where those are better."""
    found = run.tuned
    if found is not None and found.better in found.finals:
        return found.finals[found.better].held_out
    return run.outcome.method.held_out if run.outcome is not None else ()


def _rises(played: Iterable[tuple[int, float | None]]) -> tuple[tuple[int, float], ...]:
    """The points where F rose. The slots of a generation are taken in order, as if they trained one after the other."""
    found: list[tuple[int, float]] = []
    for steps, value in played:
        if value is not None and rank(value) > (found[-1][1] if found else rank(None)):
            found.append((steps, value))
    return tuple(found)


def _seconds(run: RunView) -> float:
    """Time of training: the sum over groups of lanes that train side by side, of each group's longest. Groups are a
    generation (the first with the task's own rewards), a round of final trainings or of weightings, and polishing."""

    def lanes(role: Role, seeds: Container[int]) -> set[str]:
        return {name for name, lane in run.lanes.items() if lane.role == role and lane.seed in seeds}

    config, texts = run.config, list(run.texts.values())
    rounds = [
        {slot.result.lane for slot in generation.candidates if slot.result is not None}
        for generation in run.generations
    ]
    rounds[0] |= lanes("baseline", [config.seed])
    rounds += [lanes("final", seeds) for seeds in race.rounds(final_seeds(config), raced=run.ranks == "played")]
    rounds += [
        {lane_id(text.id, config.seed) for text in texts[part.start : part.stop]} for part in tuned.rounds(config)
    ]
    rounds += [lanes("final", seeds) for seeds in race.rounds(tuning_seeds(config), raced=True)]
    rounds.append(lanes("polish", polish_seeds(config)))
    seconds, known = 0.0, set[str]()
    for own in rounds:
        seconds += max((run.results[lane].seconds for lane in own - known if lane in run.results), default=0.0)
        known |= own
    return seconds
