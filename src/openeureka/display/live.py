"""What a search shows while it runs: a table that is redrawn on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from ..config import RunConfig
from ..events import Asked, Began, Checked, Event, Played, Replied
from ..numbers import duration, number, scored, sparkline
from ..score import Outcome
from ..text import one_line
from ..types import (
    OWN_REWARDS,
    Evaluation,
    Generation,
    Sample,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    Usage,
    lane_id,
)
from .progress import ProgressLine, by_node, redraws, standard
from .tally import Tally


def verdict_line(sample: Sample) -> str:
    """`accepted`, or the code and the first finding."""
    first = sample.verdict.findings[0].sentence() if sample.verdict.findings else ""
    return str(sample.verdict.code) + (f": {one_line(first, 80)}" if first else "")


def generation_line(generation: Generation) -> str:
    best = generation.best
    return (
        f"Generation {generation.index}: best F {number(best.score if best else None)}, "
        f"{generation.trained} of {len(generation.entries)} trained"
    )


class PlainView:
    """Lines for logs and pipes."""

    def __init__(self, console: Console, config: RunConfig, usage: Usage) -> None:
        self._console = console
        self._tally = Tally(config, usage)
        self._line = ProgressLine(console)
        self._played: dict[str, Evaluation] = {}

    def __enter__(self) -> PlainView:
        return self

    def __exit__(self, *_: object) -> None: ...

    def _say(self, text: str) -> None:
        self._console.print(Text(text), soft_wrap=True)

    def __call__(self, event: Event) -> None:
        self._tally.hear(event)
        match event:
            case Began():
                self._say(self._tally.headline())
                self._line = ProgressLine(self._console)
            case Asked(slots):
                wanted = "1 reward" if len(slots) == 1 else f"{len(slots)} rewards"
                self._say(f"  asked for {wanted}: slot {', '.join(map(str, slots))}")
            case Checked(sample):
                name = sample.candidate.id if sample.candidate else "-"
                self._say(f"  slot {sample.slot}, try {sample.attempts}, {name}: {verdict_line(sample)}")
            case TrainingProgress():
                self._line.show(event)
            case TrainingResult():
                done = event.state is TrainingState.FINISHED
                state = "" if done else f", {event.state}: {one_line(event.message, 80)}"
                self._say(f"  {event.lane}: F {number(event.fitness)} in training{state}")
            case Played(scores):
                for lane in scores.keys() - self._played.keys():
                    self._say(f"  {lane}: F {scored(scores[lane])} played")
                self._played |= scores
            case Generation():
                self._say(generation_line(event))
            case Replied() | Outcome():
                pass


SCORES = ("training", "F", "F played")
WIDE = 110
SPARK, NARROW_SPARK = 24, 8
"""[characters] Length of a curve on a terminal of at least `WIDE`, and on a narrower one."""


class TerminalView:
    """One table, redrawn: a row for every slot of the generation, or for every lane of the final trainings."""

    def __init__(self, console: Console, config: RunConfig, usage: Usage) -> None:
        self._tally = Tally(config, usage)
        self._stage = ""
        """The stage whose rows are shown."""
        self._samples: dict[int, Sample] = {}
        self._places: dict[str, str] = {}
        """The first place of each candidate, by id: people know the candidate by it."""
        self._replied: set[int] = set()
        self._asked: dict[int, float] = {}
        """Slots that the model is writing for, with the time at which it began [s]."""
        self._fitness: dict[str, float | None] = {}
        self._played: dict[str, Evaluation] = {}
        self._epochs, self._nodes = "", ""
        self._curves: dict[str, list[float | None]] = {}
        """F of each lane as it trains."""
        self._spark = SPARK if console.width >= WIDE else NARROW_SPARK
        self._live = Live(console=console, get_renderable=self.render, refresh_per_second=4)

    def __enter__(self) -> TerminalView:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def __call__(self, event: Event) -> None:
        self._tally.hear(event)
        match event:
            case Began():
                self._begin(event)
            case Asked(slots):
                self._asked = dict.fromkeys(slots, time.monotonic())
            case Replied(slot=slot):
                self._asked.pop(slot, None)
                self._replied.add(slot)
            case Checked(sample):
                self._samples[sample.slot] = sample
                self._place(sample)
            case TrainingProgress():
                self._progress(event)
            case TrainingResult():
                self._fitness[event.lane] = event.fitness
            case Played(scores):
                self._played |= scores
            case Generation():  # printed above the table, which has no room for all generations
                self._live.console.print(Text(generation_line(event)))
                for entry in event.entries:  # a resumed run has no other event for them
                    self._place(entry.sample)
            case Outcome():
                pass

    def _place(self, sample: Sample) -> None:
        if sample.candidate is not None:
            self._places.setdefault(sample.candidate.id, str(sample.place))

    def _begin(self, began: Began) -> None:
        if self._tally.stage != self._stage or began.phase in ("final", "polish"):
            self._samples.clear()
            self._replied.clear()
            self._asked.clear()
            self._fitness.clear()
            self._curves.clear()
        self._stage = self._tally.stage
        self._epochs, self._nodes = "", ""
        if began.phase == "feedback":
            self._live.stop()  # the person types in the terminal
        else:
            self._live.start()

    def _progress(self, progress: TrainingProgress) -> None:
        self._fitness |= progress.fitness
        for lane, best in progress.fitness.items():
            self._curves.setdefault(lane, []).append(progress.latest.get(lane, {}).get("fitness", best))
        self._epochs = f"epoch {progress.epoch} of {progress.epochs}, {progress.env_steps_per_second:,.0f} steps/s"
        self._nodes = by_node(progress)

    def render(self) -> Group:
        lines = [Text(line) for line in (self._tally.headline(), self._epochs, self._nodes) if line]
        return Group(*lines, self._lanes() if self._tally.generation is None else self._slots())

    def _slots(self) -> Table:
        table = Table("slot", "candidate", "try", box=None, pad_edge=False)
        table.add_column("checked", overflow="ellipsis", no_wrap=True)
        for title in SCORES:
            table.add_column(title, no_wrap=True)
        seed = self._tally.config.seed
        for slot in range(1 + max(self._tally.config.sample - 1, -1, *self._samples, *self._asked)):
            sample = self._samples.get(slot)
            if slot in self._asked:
                table.add_row(str(slot), "", "", self._writing(slot))
                continue
            if sample is None:
                table.add_row(str(slot), "", "", "replied" if slot in self._replied else "")
                continue
            name = sample.candidate.id if sample.candidate else "-"
            scores = self._scores(lane_id(name, seed))
            table.add_row(str(slot), name, str(sample.attempts), Text(verdict_line(sample)), *scores)
        for name in OWN_REWARDS:
            if lane_id(name, seed) in self._fitness:
                table.add_row("", f"{name} reward", "", "", *self._scores(lane_id(name, seed)))
        return table

    def _writing(self, slot: int) -> str:
        """That the model is writing for a slot, for how long, and why it was asked again."""
        sample = self._samples.get(slot)
        again = ""
        if sample is not None:
            again = " again: it repeated a reward" if sample.verdict.accepted else " again: it was refused"
        return f"being written{again}, {duration(time.monotonic() - self._asked[slot])}"

    def _lanes(self) -> Table:
        table = Table("reward, seed", *SCORES, box=None, pad_edge=False)
        for lane in self._fitness:
            reward, _, seed = lane.rpartition("-s")
            table.add_row(Text(f"{self._places.get(reward, reward)}, {seed}"), *self._scores(lane))
        return table

    def _scores(self, lane: str) -> tuple[str, str, str]:
        curve = self._curves.get(lane, ())
        return (
            sparkline(curve, self._spark) if curve else "",
            number(self._fitness.get(lane)),
            scored(self._played.get(lane)),
        )


def view(config: RunConfig, usage: Usage, console: Console | None = None) -> PlainView | TerminalView:
    """The display that suits the console; `usage` is what earlier processes of this run spent."""
    console = console or standard()
    return (TerminalView if redraws(console) else PlainView)(console, config, usage)
