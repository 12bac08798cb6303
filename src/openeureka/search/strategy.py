"""How the next prompts follow from what was learnt. A strategy holds no state: all of it is in the History."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Literal, Protocol

from ..config import RunConfig
from ..types import Generation, History, PromptPlan, Scored


class SearchStrategy(Protocol):
    """Decides who becomes a parent."""

    @property
    def checkpoint(self) -> Literal["fitness", "reward"]:
        """Which checkpoint of a lane stands for its reward: at the peak of F, or of the lane's own reward."""
        ...

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        """The prompts of the next generation; their counts add up to its slots."""
        ...

    def tell(self, history: History, entries: Sequence[Scored]) -> History:
        """The history with one more generation; the one given stays as it is."""
        ...


_EARLIER_TURNS = 3
"""Winners that `best` shows before the parent: four turns in all."""


@dataclass(frozen=True, slots=True)
class Eureka:
    """As published: greedy. The best of the last generation is the parent, even where an earlier one was better."""

    samples: int
    checkpoint: Literal["fitness", "reward"] = "fitness"

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        winners = _winners(history)
        return [PromptPlan(count=self.samples, turns=tuple(winners[-1:]), failures=_failures(history))]

    def tell(self, history: History, entries: Sequence[Scored]) -> History:
        return _grown(history, entries)


@dataclass(frozen=True, slots=True)
class Best:
    """The best reward so far is the parent, and the winners of recent generations show the way that led to it.

    Its lanes are judged by the checkpoint at their own peak reward: F then stays a judge that training never saw.
    """

    samples: int
    checkpoint: Literal["fitness", "reward"] = "reward"

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        parent = history.best
        if parent is None:
            return [PromptPlan(count=self.samples, failures=_failures(history))]
        others = {winner.sample.candidate: winner for winner in _winners(history)}
        others.pop(parent.sample.candidate)
        turns = (*list(others.values())[-_EARLIER_TURNS:], parent)
        return [PromptPlan(count=self.samples, turns=turns, failures=_failures(history))]

    def tell(self, history: History, entries: Sequence[Scored]) -> History:
        return _grown(history, entries)


def make(config: RunConfig) -> SearchStrategy:
    """The strategy that `search=` names. Both are greedy, so neither draws from the generator it is given."""
    return {"eureka": Eureka, "best": Best}[config.search](config.sample)


_SIZES = {"free": (16, 5), "grammar": (8, 3)}
"""K and N where the user names none; a model on two cores takes minutes for what an endpoint does in seconds."""


def sized(config: RunConfig, style: Literal["free", "grammar"]) -> RunConfig:
    """The settings with `sample` and `iteration` filled in for a model of this style."""
    sample, iteration = _SIZES[style]
    return dataclasses.replace(config, sample=config.sample or sample, iteration=config.iteration or iteration)


def _winners(history: History) -> list[Scored]:
    """The best entry of each generation in which anything trained, oldest first."""
    return [generation.best for generation in history.generations if generation.best is not None]


def _failures(history: History) -> tuple[Scored, ...]:
    """The entries of the last generation when nothing in it trained: the next prompt says why."""
    if not history.generations or history.generations[-1].best is not None:
        return ()
    return history.generations[-1].entries


def _grown(history: History, entries: Sequence[Scored]) -> History:
    return History((*history.generations, Generation(len(history.generations), tuple(entries))))
