"""The method on one screen: ask, sample, check, train, play, reflect; in the end, confirm the best reward.

Every step goes through the store: finished steps are read, missing ones are done. To resume is to run again.
"""

from __future__ import annotations

from random import Random

from .config import RunConfig
from .events import Began, Tell
from .llm.client import LanguageModel
from .method import race, screen
from .method.lanes import Lanes
from .method.person import Desk, Hearing
from .method.reflection import scored
from .method.sampling import Checker, Sampler
from .method.seeds import deal, programs, trained_baselines
from .refine import polishing, tuning
from .score import Outcome
from .store import Store
from .strategies import Ranking, SearchStrategy, asked
from .types import TaskContext, Trainer


def run(
    config: RunConfig,
    store: Store,
    model: LanguageModel,
    checker: Checker,
    trainer: Trainer,
    context: TaskContext,
    strategy: SearchStrategy,
    tell: Tell,
    desk: Desk,
) -> Outcome:
    """Run the generations that the store lacks, up to `config.generations`, then confirm the best reward. Where the
    settings say so, fit that reward's numbers and train its policy further.

    Raises:
        EurekaError: what stopped the run; all that was finished is stored, and running again continues.
    """
    sampler = Sampler(config, store, model, checker, context, tell)
    lanes = Lanes(config, store, trainer, tell, strategy.ranks, strategy.peaks)
    hearing = Hearing(config, store, desk, tell)
    history = store.history()
    for generation in history.generations:
        tell(generation)
    history = history.rescored(lanes.play(history.lanes))  # nothing is left to play: listeners hear the scores

    for index in range(len(history.generations), config.generations):
        history = hearing.hear(history)
        plans = asked(strategy, history, Random(f"{config.seed}/{index}"), config.sample)
        samples = sampler.initial() if config.init and not index else screen.fill(index, plans, sampler, lanes, history)
        model.close()  # an embedded model must not run while training does: both would compete for the same cores

        tell(Began("train", index))
        wanted = deal(programs(samples), [config.seed], "candidate")
        if index == 0:
            wanted += deal(trained_baselines(config), [config.seed], "baseline")
        results = lanes.train(wanted)
        if strategy.ranks == "played":
            tell(Began("play", index))
        scores = lanes.play([*history.lanes, *results])

        entries = scored(config, samples, results, scores, style=model.style, window=context.window)
        history = history.rescored(scores).grown(entries)
        lanes.keep(Ranking(history).best)
        store.save_generation(history.generations[-1])
        tell(history.generations[-1])

    history = hearing.hear(history)  # where votes decide, the last generation needs votes too
    if not tuning.begun(store):
        race.conclude(history, lanes)
    winner = history.entry(store.crown()) or Ranking(history).best
    tuned = tuning.tune_winner(lanes, checker, winner) if config.tune else None
    if config.polish and (tuned is not None or store.crown() is not None):
        polishing.polish(lanes)
    log = store.lanes
    outcome = race.outcome(config, history, store.crown(), log.results(), log.evaluations(), log.tryouts())
    store.end(outcome.word)
    tell(outcome)
    return outcome
