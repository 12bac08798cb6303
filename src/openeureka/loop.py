"""The method on one screen: ask, sample, check, train, reflect, tell; in the end, score the best reward.

Every step goes through the store: what is there is read, what is missing is done. To resume is to run again.
"""

from __future__ import annotations

from random import Random

from .config import RunConfig
from .lanes import BASELINES, Lanes, lane, programs
from .llm.client import LanguageModel
from .observer import NullObserver, Observer
from .reflection import reflect
from .sampling import Checker, Sampler
from .score import Outcome, compare, rank
from .search import SearchStrategy
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
) -> Outcome:
    """Search for `config.iteration` generations, less those in the store, then score the best reward.

    Raises:
        EurekaError: what stopped the run; all that was finished is stored, and running again continues.
    """
    observer = observer or NullObserver()
    sampler = Sampler(config, store, model, checker, context, observer)
    lanes = Lanes(config, store, trainer, observer)
    history = store.history()
    for generation in history.generations:
        observer.generation(generation)

    for index in range(len(history.generations), config.iteration):
        plans = strategy.ask(history, Random(f"{config.seed}/{index}"))
        samples = sampler.fill(index, plans)
        model.close()  # an embedded model must not run while training does: they fight for the same cores

        observer.phase(index, "train")
        baselines = BASELINES if index == 0 else ()
        results = lanes.train([*programs(samples), *baselines], seeds=[config.seed])

        entries = []
        for sample in samples:
            result = results.get(lane(sample.verdict.candidate, config.seed))
            entries.append(Scored(sample=sample, result=result, feedback=reflect(sample, result, model.style)))
        history = strategy.tell(history, entries)
        store.save_generation(history.generations[-1])
        observer.generation(history.generations[-1])

    outcome = conclude(config, store, lanes, strategy, history, observer)
    observer.outcome(outcome)
    return outcome


def conclude(
    config: RunConfig, store: Store, lanes: Lanes, strategy: SearchStrategy, history: History, observer: Observer
) -> Outcome:
    """Retrain the best reward with fresh seeds beside the human and the sparse one, and score all on held-out episodes.

    The search's own F is the maximum of many tries; only fresh seeds and fresh episodes say what the reward is worth.
    """
    best = history.best
    if best is None or best.sample.candidate is None:
        return Outcome(best=None)
    candidate = best.sample.candidate

    observer.phase(config.iteration, "final")
    seeds = range(config.seed + 1, config.seed + 1 + config.seeds)
    results = lanes.train([*programs([best.sample]), *BASELINES], seeds)
    observer.phase(config.iteration, "evaluate")
    scores = lanes.evaluate(results, strategy.checkpoint)

    names = {"method": candidate.id, "human": "human", "sparse": "sparse"}
    arms = {arm: [lane(name, seed) for seed in seeds] for arm, name in names.items()}
    ranked = {job: scores[job].fitness for job in arms["method"] if job in scores}
    winner = max(ranked, key=lambda job: rank(ranked[job]), default=lane(candidate.id, config.seed))
    store.save_best(candidate, store.policy(winner, strategy.checkpoint))
    return compare(best, arms, results, scores)
