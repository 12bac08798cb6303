"""A run without generations: given rewards train side by side, and are compared."""

from __future__ import annotations

from collections.abc import Mapping

from .config import RunConfig
from .errors import StoreError
from .lanes import BASELINES, Lanes, deal
from .observer import NullObserver, Observer
from .score import mean, rank
from .store import Store
from .strategies import Best
from .types import GIVEN, Candidate, Reply, RewardProgram, Trainer, Verdict

Given = Mapping[str, tuple[Candidate, Verdict] | None]
"""Rewards by name, each with the verdict that accepted it; None for those that come with the task."""


def keep(store: Store, rewards: Given) -> None:
    """Have the store hold the rewards, so that a run that goes on needs no file.

    Raises:
        StoreError: when it holds others.
    """
    known, wanted = store.given(), {name: found[0].id if found else None for name, found in rewards.items()}
    if known and known != wanted:
        raise StoreError(
            f"{store.directory} holds a run of other rewards ({', '.join(known)}); name those, as they were, or "
            "choose another dir=."
        )
    for found in rewards.values():
        if found is not None and store.verdict(found[0].id) is None:
            store.save_verdict(*found, Reply(text=found[0].source, model=GIVEN))
    if not known:
        store.save_given(wanted)


def train(config: RunConfig, store: Store, trainer: Trainer, observer: Observer | None = None) -> None:
    """Train the store's given rewards with every seed, play their policies and score them on held-out episodes.

    `best/` gets the policy of highest held-out F, of the reward whose mean is the highest.

    Raises:
        EurekaError: what stopped it; all that was finished is stored, and calling again continues.
    """
    if not store.given():  # killed between the two first rows of the run
        raise StoreError(
            f"{store.directory} holds no rewards yet; start it again with the same `eureka train` command."
        )
    observer = observer or NullObserver()
    lanes, strategy = Lanes(config, store, trainer, observer), Best(samples=0)
    observer.phase(0, "train")
    results = lanes.train(deal(programs(store).items(), seeds(config), "given"))
    observer.phase(0, "play")
    lanes.play(results, strategy)
    observer.phase(0, "evaluate")
    standing = lanes.standing(results, strategy)
    scores = {lane: score.fitness for lane, score in lanes.evaluate(standing).items()}
    arms = {name: [lane.id for lane in store.lanes.all().values() if lane.reward == name] for name in store.given()}
    best = max(arms, key=lambda name: rank(mean([scores.get(lane) for lane in arms[name]])))
    lane = max(arms[best], key=lambda lane: rank(scores.get(lane)))
    store.save_best(store.candidate(store.given()[best]), lane, standing[lane])


def programs(store: Store) -> dict[str, RewardProgram]:
    """What the given rewards train under, by name."""
    found: dict[str, RewardProgram] = {}
    for name, candidate in store.given().items():
        verdict = store.verdict(candidate) if candidate is not None else None
        program = verdict.graph if verdict is not None else dict(BASELINES)[name]
        assert program is not None  # what was refused is never kept
        found[name] = program
    return found


def seeds(config: RunConfig) -> range:
    """Those that every given reward trains with."""
    return range(config.seed, config.seed + config.seeds)
