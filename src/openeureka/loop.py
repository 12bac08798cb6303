"""The method on one screen: ask, sample, check, train, play, reflect; in the end, confirm the best reward.

Every step goes through the store: what is there is read, what is missing is done. To resume is to run again.
"""

from __future__ import annotations

from random import Random

from .config import RunConfig
from .events import Began, Tell
from .llm.client import LanguageModel
from .method import hacking, race, screen
from .method.lanes import Lanes
from .method.person import Desk, Hearing
from .method.reflection import reflect
from .method.sampling import Checker, Sampler
from .method.seeds import beside, deal, programs
from .refine import polishing, tuning
from .score import Outcome, worth
from .store import Store
from .strategies import Ranking, SearchStrategy, asked
from .types import History, PolicyId, Scored, TaskContext, Trainer, lane_id


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
    """Search for `config.generations` generations, less those in the store, then confirm the best reward. Fit its
    numbers and carry its policy on, where the settings say so.

    Raises:
        EurekaError: what stopped the run; all that was finished is stored, and running again continues.
    """
    sampler = Sampler(config, store, model, checker, context, tell)
    lanes = Lanes(config, store, trainer, tell, strategy.ranks, strategy.peaks)
    hearing = Hearing(config, store, desk, tell)
    history = store.history()
    for generation in history.generations:
        tell(generation)
    history = history.rescored(lanes.play(history.lanes))  # finds nothing to do unless it was stopped while they played

    for index in range(len(history.generations), config.generations):
        history = hearing.hear(history)
        plans = asked(strategy, history, Random(f"{config.seed}/{index}"), config.sample)
        samples = sampler.initial() if config.init and not index else screen.fill(index, plans, sampler, lanes, history)
        model.close()  # an embedded model must not run while training does: they fight for the same cores

        tell(Began("train", index))
        wanted = deal(programs(samples), [config.seed], "candidate")
        if index == 0:
            wanted += deal(beside(config), [config.seed], "baseline")
        results = lanes.train(wanted)
        if strategy.ranks == "played":
            tell(Began("play", index))
        scores = lanes.play([*history.lanes, *results])

        entries: list[Scored] = []
        for sample in samples:
            lane = lane_id(sample.verdict.candidate, config.seed)
            result, played = results.get(lane), scores.get(lane)
            feedback = reflect(sample, result, model.style, played, config.cost_limits, context.window)
            entries.append(Scored(sample=sample, result=result, played=played, feedback=feedback))
        history = history.rescored(scores).grown(entries)
        keep(lanes, Ranking(history).best)
        store.save_generation(history.generations[-1])
        tell(history.generations[-1])

    history = hearing.hear(history)  # where votes decide, the last generation needs some too
    if not tuning.begun(store):
        conclude(lanes, history)
    winner = history.entry(store.crown()) or Ranking(history).best
    tuned = tuning.tune_winner(lanes, checker, winner) if config.tune else None
    if config.polish and (tuned is not None or store.crown() is not None):
        polishing.polish(lanes)
    outcome = race.outcome(config, history, store.crown(), store.lanes.results(), store.lanes.evaluations())
    store.end(outcome.word)
    tell(outcome)
    return outcome


def conclude(lanes: Lanes, history: History) -> None:
    """Confirm the best reward with fresh seeds, then score it beside the human and the sparse one on held-out episodes.
    Where there is one, the store holds its crown, and `best/` its policy.

    The search's own scores are the best of many tries; only fresh seeds and fresh episodes say what a reward is worth.
    """
    config, store, tell = lanes.config, lanes.store, lanes.tell
    tell(Began("final"))
    confirmed = history.entry(store.crown())
    best = confirmed or race.crown(history, lanes)
    if best is None:
        keep(lanes, Ranking(history).best)
        return score_nearest(lanes, history)
    tell(Began("evaluate"))
    finals = lanes.final(race.contenders(history))
    scores = lanes.evaluate(lanes.counted_peaks([lane for arm in finals.values() for lane in arm]))
    results = store.lanes.results()
    own = {lane: results[lane] for lane in finals[best.candidate_id] if lane in scores}
    winner = max(own, key=lambda lane: worth(scores[lane], config.cost_limits), default=None)
    keep(lanes, best, winner)
    if winner is not None:
        lanes.try_out(hacking.tryouts(own, winner, lanes.counted_peaks(own)))
    if confirmed is None:
        store.save_crown(best.sample.place)


def score_nearest(lanes: Lanes, history: History) -> None:
    """Where nobody wins, tell that in numbers too: those of the candidate that came nearest, held out."""
    ranking = Ranking(history)
    nearest = ranking.nearest or ranking.best
    if nearest is not None and nearest.result is not None:
        lanes.tell(Began("evaluate"))
        lanes.evaluate(lanes.counted_peaks([nearest.result.lane]))


def keep(lanes: Lanes, best: Scored | None, lane: str | None = None) -> None:
    """Leave the best reward, if any, in `best/`, with the policy of a lane; None for its lane in the search."""
    if best is None:  # who led may be rejected by now
        return lanes.store.folders.clear("best")
    lane = lane or lane_id(best.candidate_id, lanes.config.seed)
    lanes.store.save_best(best.sample.candidate, PolicyId(lane, lanes.counted_peaks([lane])[lane]))
