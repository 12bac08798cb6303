"""The method on one screen: ask, sample, check, train, reflect, tell; in the end, score the best reward.

Every step goes through the store: what is there is read, what is missing is done. To resume is to run again.
"""

from __future__ import annotations

from random import Random

from . import baselines, hacking
from .config import RunConfig
from .lanes import Lanes, beside, final_lanes, final_seeds, lane, programs
from .llm.client import LanguageModel
from .observer import NullObserver, Observer
from .person import Desk, EmptyDesk, Hearing
from .reflection import reflect
from .sampling import Checker, Sampler
from .score import Outcome, compare, rank
from .search import Ranking, SearchStrategy
from .store import Store
from .types import History, Scored, TaskContext, Trainer


def run(
    config: RunConfig,
    store: Store,
    model: LanguageModel,
    checker: Checker,
    trainer: Trainer,
    context: TaskContext,
    strategy: SearchStrategy,
    observer: Observer | None = None,
    desk: Desk | None = None,
) -> Outcome:
    """Search for `config.generations` generations, less those in the store, then score the best reward.

    Raises:
        EurekaError: what stopped the run; all that was finished is stored, and running again continues.
    """
    observer = observer or NullObserver()
    baselines.chosen(config)  # refuses before anything is paid for
    sampler = Sampler(config, store, model, checker, context, observer)
    lanes = Lanes(config, store, trainer, observer)
    hearing = Hearing(config, store, desk or EmptyDesk(), observer)
    history = store.history()
    for generation in history.generations:
        observer.generation(generation)

    for index in range(len(history.generations), config.generations):
        history = hearing.hear(history)
        plans = strategy.ask(history, Random(f"{config.seed}/{index}"))
        samples = sampler.given() if config.init and index == 0 else sampler.fill(index, plans)
        model.close()  # an embedded model must not run while training does: they fight for the same cores

        observer.phase(index, "train")
        others = beside(config) if index == 0 else ()
        results = lanes.train([*programs(samples), *others], seeds=[config.seed])

        entries = []
        for sample in samples:
            result = results.get(lane(sample.verdict.candidate, config.seed))
            entries.append(Scored(sample=sample, result=result, feedback=reflect(sample, result, model.style)))
        history = strategy.tell(history, entries)
        best = Ranking(history).best
        if best is not None:
            store.save_best(best, lane(best.sample.verdict.candidate, config.seed), strategy.checkpoint)
        store.save_generation(history.generations[-1])
        observer.generation(history.generations[-1])

    history = hearing.hear(history)  # where votes decide, the last generation needs some too
    best = Ranking(history).best
    if best is not None:
        conclude(config, store, lanes, strategy, best, observer)
    outcome = summarise(config, store, history)
    observer.outcome(outcome)
    return outcome


def conclude(
    config: RunConfig, store: Store, lanes: Lanes, strategy: SearchStrategy, best: Scored, observer: Observer
) -> None:
    """Retrain the best reward with fresh seeds beside the human and the sparse one, and score all on held-out episodes.

    The search's own F is the maximum of many tries; only fresh seeds and fresh episodes say what the reward is worth.
    """
    observer.phase(config.generations, "final")
    results = lanes.train([*programs([best.sample]), *beside(config)], final_seeds(config))
    observer.phase(config.generations, "evaluate")
    scores = lanes.evaluate(results, strategy.checkpoint)
    own = {job: results[job] for job in final_lanes(config, best)["method"] if job in scores}
    winner = max(own, key=lambda job: rank(scores[job].fitness), default=None)
    store.save_best(best, winner or lane(best.sample.verdict.candidate, config.seed), strategy.checkpoint)
    if winner is not None:
        lanes.try_out(hacking.trials(own, winner, strategy.checkpoint))


def summarise(config: RunConfig, store: Store, history: History) -> Outcome:
    """The outcome as far as the store holds it."""
    best = Ranking(history).best
    if best is None:
        return Outcome(best=None)
    return compare(best, final_lanes(config, best), store.results(), store.evaluations(), baselines.chosen(config))
