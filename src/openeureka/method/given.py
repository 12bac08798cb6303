"""A run without generations: given rewards train side by side, and are compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..config import RunConfig
from ..errors import StoreError
from ..events import Began
from ..score import rank
from ..stats import mean
from ..store import Store
from ..types import GIVEN, Candidate, Lane, Reply, RewardProgram, Verdict
from . import hacking
from .lanes import Lanes
from .seeds import Wanted, deal

Given = Mapping[str, tuple[Candidate, Verdict] | None]
"""Rewards by name, each with the verdict that accepted it; None for those that come with the task."""


def keep(store: Store, rewards: Given) -> None:
    """Have the store hold the rewards, so that a resumed run needs no file.

    Raises:
        StoreError: when the store holds other rewards.
    """
    known, wanted = store.rewards.named(), {name: found[0].id if found else None for name, found in rewards.items()}
    if known and known != wanted:
        raise StoreError(
            f"{store.directory} holds a run of other rewards ({', '.join(known)}); name those, unchanged, or choose "
            "another dir=."
        )
    for found in rewards.values():
        if found is not None and store.rewards.verdict(found[0].id) is None:
            store.rewards.save_verdict(*found, Reply(text=found[0].source, model=GIVEN))
    if not known:
        store.rewards.save_named(wanted)


def train(lanes: Lanes, more: Iterable[Wanted] | None = None) -> None:
    """Train the store's given rewards, play their policies and score them on held-out episodes.

    Untrained policies play too, as they tell whether anything was learnt. `best/` gets the policy of highest held-out
    F, of the reward with the highest mean.

    Args:
        lanes: lanes of the run.
        more: lanes to train besides those already begun; None for every reward with every seed of the settings.

    Raises:
        EurekaError: what stopped it; all that was finished is stored, and calling again continues.
    """
    store = lanes.store
    rewards = programs(store)
    if not rewards:  # killed between the two first rows of the run
        raise StoreError(
            f"{store.directory} holds no rewards yet; start it again with the same `eureka train` command."
        )
    known = of_given(store).values()
    wanted: list[Wanted] = [(lane, rewards[lane.reward]) for lane in known if lane.reward in rewards]
    wanted += deal(rewards.items(), seeds(lanes.config), "given") if more is None else more
    lanes.tell(Began("train"))
    results = lanes.train(wanted)
    lanes.tell(Began("play"))
    lanes.play(results)
    lanes.tell(Began("evaluate"))
    scores = lanes.evaluate(lanes.counted_peaks(results))
    begun = of_given(store)
    first = next((lane for lane in begun if lane in scores), None)
    if first is not None and lanes.config.seeds > 1:  # one seed says nothing, however untrained policies play
        lanes.try_out(hacking.beginners(first, begun[first].seed, lanes.judged(first).peak))
    fitness = {lane: score.fitness for lane, score in scores.items()}
    by_reward: dict[str, list[str]] = {}
    for lane, record in begun.items():
        by_reward.setdefault(record.reward, []).append(lane)
    best = max(by_reward, key=lambda name: rank(mean([fitness.get(lane) for lane in by_reward[name]])))
    lane = max(by_reward[best], key=lambda lane: rank(fitness.get(lane)))
    store.save_best(store.rewards.candidate(store.rewards.named()[best]), lanes.judged(lane))


def of_given(store: Store) -> dict[str, Lane]:
    """The lanes of given rewards by their ids."""
    return {lane: record for lane, record in store.lanes.all().items() if record.role == "given"}


def programs(store: Store) -> dict[str, RewardProgram]:
    """Programs of the given rewards, by name."""
    found: dict[str, RewardProgram] = {}
    for name in store.rewards.named():
        own = store.rewards.program(name)
        assert own is not None  # a refused reward is never stored
        found[name] = own
    return found


def seeds(config: RunConfig) -> range:
    """Seeds that every given reward trains with."""
    return range(config.seed, config.seed + config.seeds)
