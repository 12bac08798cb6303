"""How the next prompts follow from what was learnt. A strategy holds no state: everything is in the History."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Protocol

from ..config import RunConfig
from ..errors import ConfigError
from ..plugins import Door
from ..types import PEAKS, History, Opinion, Peak, PromptPlan, Ranks, RemarkKind, Scored, Style, VerdictCode
from .ranking import Ranking


class SearchStrategy(Protocol):
    """Decides which rewards become parents."""

    @property
    def ranks(self) -> Ranks:
        """What ranks candidates: F of their policies when played, or the maximum of F over training."""
        ...

    @property
    def peaks(self) -> tuple[Peak, ...]:
        """Policies of a lane that may stand for its reward: the best when played, or the first where none plays."""
        ...

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        """The prompts of the next generation; their counts add up to its slots."""
        ...


_EARLIER_TURNS = 3
"""Winners that `best` shows before the parent: four turns in all."""


@dataclass(frozen=True, slots=True)
class Eureka:
    """As published: greedy. The best of the last generation is the parent, even where an earlier one was better."""

    samples: int
    ranks: Ranks = "training"
    peaks: tuple[Peak, ...] = ("fitness",)

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        ranking = Ranking(history)
        parents = [*ranking.winners[-1:]] if ranking.favourite is None else [ranking.favourite]
        return [prompt_plan(self.samples, parents, history, ranking)]


@dataclass(frozen=True, slots=True)
class Best:
    """The parent is the reward that plays best so far, shown after the winners of recent generations."""

    samples: int
    ranks: Ranks = "played"
    peaks: tuple[Peak, ...] = PEAKS

    def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
        ranking = Ranking(history)
        parent = ranking.favourite or ranking.best or ranking.nearest
        if parent is None:
            return [replace(prompt_plan(self.samples, [], history, ranking), informed=True)]
        others = {winner.sample.candidate: winner for winner in ranking.winners}
        others.pop(parent.sample.candidate, None)  # a favourite need not have won its generation
        plan = prompt_plan(self.samples, [*list(others.values())[-_EARLIER_TURNS:], parent], history, ranking)
        siblings = _siblings(parent, history, ranking)
        return [replace(plan, informed=True, best=ranking.best, siblings=siblings)]


def eureka(config: RunConfig) -> Eureka:
    return Eureka(config.sample)


def best(config: RunConfig) -> Best:
    return Best(config.sample)


SEARCHES = Door(
    setting="search",
    group="openeureka.searches",
    built_in={"best": f"{__name__}:best", "eureka": f"{__name__}:eureka"},
    members=("ranks", "peaks", "ask"),
)
"""Each is called with the settings of the run, with `sample` filled in, and makes a `SearchStrategy`."""


def make(config: RunConfig) -> SearchStrategy:
    """The strategy that `search=` names. The built-in ones are greedy: they do not use the random generator of `ask`.

    Raises:
        ConfigError: when there is none of that name, it is no strategy, or settings need one that plays policies.
    """
    found: SearchStrategy = SEARCHES.make(config.search, config)
    if found.ranks == "training" and (config.cost_limits or config.screen > 1):
        key = "limits" if config.cost_limits else "screen"
        raise ConfigError(
            f"`search={config.search}` ranks by F in training, but `{key}=` needs played policies; leave one out."
        )
    return found


def asked(strategy: SearchStrategy, history: History, rng: Random, slots: int) -> Sequence[PromptPlan]:
    """The prompts that the strategy asks for. Raises ConfigError where they have another number of samples."""
    found = strategy.ask(history, rng)
    if (wanted := sum(plan.count for plan in found)) != slots:
        raise ConfigError(f"`ask` of {type(strategy).__name__} asks for {wanted} samples, but sample={slots}.")
    return found


_SIZES = {"free": (16, 5), "grammar": (8, 3)}
"""Default `sample` and `iteration` by style: the embedded model takes minutes for what an endpoint does in seconds."""


def sized(config: RunConfig, style: Style) -> RunConfig:
    """The settings with `sample` and `iteration` filled in for a model of this style."""
    sample, iteration = _SIZES[style]
    return replace(config, sample=config.sample or sample, iteration=config.iteration or iteration)


def prompt_plan(samples: int, turns: Sequence[Scored], history: History, ranking: Ranking) -> PromptPlan:
    """A prompt for so many rewards: the turns that the model is shown as its own earlier answers, the parent last; why
    the last generation failed, if nothing in it trained; and what a person said.
    """
    return PromptPlan(
        count=samples,
        turns=tuple(turns),
        failures=_failures(history),
        opinion=_opinion(turns[-1] if turns else None, history, ranking),
        limits=history.limits,
    )


def _siblings(parent: Scored, history: History, ranking: Ranking) -> tuple[Scored, ...]:
    """The other programs of the parent's generation, each once, without those that a person rejected."""
    entries = history.generations[parent.sample.generation].entries
    others = {entry.candidate_id: entry for entry in reversed(entries)}
    left_out = {parent.candidate_id, *ranking.rejected}
    return tuple(entry for own, entry in reversed(others.items()) if own not in left_out)


def _failures(history: History) -> tuple[Scored, ...]:
    """The entries of the last generation when nothing in it trained: the next prompt says why."""
    if not history.generations or any(entry.trained for entry in history.generations[-1].entries):
        return ()
    # Screened programs are left out: nothing was wrong with them, others were preferred.
    return tuple(e for e in history.generations[-1].entries if e.sample.verdict.code is not VerdictCode.SCREENED)


def _opinion(parent: Scored | None, history: History, ranking: Ranking) -> Opinion:
    remarks = [remark for generation in history.generations for remark in generation.remarks]
    own = parent.candidate_id if parent is not None else None
    won, lost = ranking.record(own) if own is not None else (0, 0)
    return Opinion(
        words=tuple(remark.text for remark in remarks if remark.kind is RemarkKind.WORDS),
        chosen=ranking.favourite is not None and ranking.favourite.candidate_id == own,
        won=won,
        lost=lost,
        vetoed=ranking.vetoed,
        by_votes=ranking.by_votes,
    )
