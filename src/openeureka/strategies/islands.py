"""A population on islands: lines of rewards that improve apart, so that no single line takes over.

The idea is that of FunSearch (doi 10.1038/s41586-023-06924-6). The method here is simpler: no clusters, no sampling by
length, and the parent is always the best.

Not measured yet. `eureka bench benchmarks/plans/population.yaml` compares it with `best` and `eureka` at matched
environment steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from random import Random

from ..config import RunConfig
from ..types import Generation, History, PromptPlan, Scored
from .ranking import Ranking
from .strategy import Best, prompt_plan

ISLANDS = 4
"""Most islands; each has at least two slots of a generation."""
RENEWAL = 3
"""Generations after which the weakest island begins anew."""
CROSSOVER = 0.5
"""Share of the prompts that show two parents, where an island has two."""


@dataclass(frozen=True, slots=True)
class Islands(Best):
    """Every island has its own slots and its own line of rewards. Its best reward is the parent (*mutate*), or its two
    best are (*crossover*: the model is asked to combine what is good in both; the store names the better one as the
    parent). Now and then the weakest island begins anew, from the best reward of another.

    No island is shown the rewards of another. A person's favourite is the parent on all islands.
    """

    @property
    def count(self) -> int:
        return max(1, min(ISLANDS, self.samples // 2))

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        ranking = Ranking(history)
        if ranking.best is None:  # no island has a line yet: all prompts would be the same
            return Best.ask(self, history, rng)
        lines = [self._line(island, start, history) for island, start in enumerate(self._starts(history))]
        return [self._plan(island, lines, history, ranking, rng) for island in range(self.count)]

    def _plan(
        self, island: int, lines: Sequence[Sequence[Scored]], history: History, ranking: Ranking, rng: Random
    ) -> PromptPlan:
        parents = [ranking.favourite] if ranking.favourite else _ahead(lines[island], ranking)
        if not parents:  # the island begins anew, or none of its rewards may be a parent
            others = [ahead[0] for line in lines if line is not lines[island] and (ahead := _ahead(line, ranking))]
            parents = [rng.choice(others)] if others else [ranking.best] if ranking.best else []
        crossover = len(parents) > 1 and rng.random() < CROSSOVER
        slots = sum(self.island(slot, self.samples) == island for slot in range(self.samples))
        plan = prompt_plan(slots, parents[::-1] if crossover else parents[:1], history, ranking)
        return replace(plan, informed=True, best=ranking.best, crossover=crossover)

    def island(self, slot: int, slots: int) -> int:
        """The island of a slot in a generation of `slots`: with `screen=` a generation has several times as many slots
        as train, and that of a given reward has one."""
        times = max(1, slots // self.samples)
        return min(slot // times * self.count // self.samples, self.count - 1)

    def _line(self, island: int, start: int, history: History) -> list[Scored]:
        """The island's entries since it began, in generation `start`."""
        return [entry for generation in history.generations[start:] for entry in self._own(generation, island)]

    def _own(self, generation: Generation, island: int) -> list[Scored]:
        slots = len(generation.entries)
        return [entry for entry in generation.entries if self.island(entry.sample.slot, slots) == island]

    def _starts(self, history: History) -> list[int]:
        """The generation in which each island began.

        Today's scores decide which island was the weakest at that time. A policy that has played again since, or a
        later vote, may give another answer than at that time.
        """
        starts = [0] * self.count
        for end in range(RENEWAL, len(history.generations) + 1, RENEWAL):
            past = replace(history, generations=history.generations[:end])
            ranking = Ranking(past)
            best = [ranking.best_of(self._line(island, start, past)) for island, start in enumerate(starts)]
            worth = list(map(ranking.worth, best))
            if self.count > 1:
                starts[worth.index(min(worth))] = end
        return starts


def _ahead(line: Sequence[Scored], ranking: Ranking) -> list[Scored]:
    """The best of a line, then the best of its other programs, as far as there are any."""
    best = ranking.best_of(line)
    if best is None:
        return []
    others = [entry for entry in line if entry.candidate_id != best.candidate_id]
    second = ranking.best_of(others)
    return [best, second] if second is not None else [best]


def islands(config: RunConfig) -> Islands:
    """For `search=openeureka.strategies.islands:islands`."""
    return Islands(config.sample)
