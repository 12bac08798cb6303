"""Which lanes a run trains: under which reward, and with which seed."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

from ..config import NO_MODEL, RunConfig
from ..types import (
    OWN_REWARDS,
    CandidateId,
    Lane,
    RewardGraph,
    RewardProgram,
    Role,
    Sample,
    Scored,
    lane_id,
)

Wanted = tuple[Lane, RewardProgram]
"""A lane, and the program that it trains under."""


def deal(rewards: Iterable[tuple[str, RewardProgram]], seeds: Iterable[int], role: Role) -> list[Wanted]:
    """A lane for every reward and seed."""
    return [(Lane(name, seed, role), program) for name, program in rewards for seed in seeds]


def programs(samples: Iterable[Sample]) -> list[tuple[CandidateId, RewardGraph]]:
    """The accepted programs by id; equal ones once."""
    graphs = {sample.verdict.candidate: sample.verdict.graph for sample in samples}
    return [(candidate, graph) for candidate, graph in graphs.items() if graph is not None]


def trained_baselines(config: RunConfig) -> tuple[tuple[str, RewardProgram], ...]:
    """The human and the sparse reward, with which candidates are compared, if the run trains them itself."""
    return tuple((name, name) for name in OWN_REWARDS) if config.baselines == "train" else ()


def final_seeds(config: RunConfig) -> range:
    """Seeds that the final trainings may take; the search trains with `config.seed`."""
    return range(config.seed + 1, config.seed + 1 + config.seeds)


def polish_seeds(config: RunConfig) -> range:
    """Seeds of the lanes that train the best policy further: no other lane has them."""
    return range(config.seed + 1 + config.seeds, config.seed + 1 + config.seeds + config.polish)


def tuning_seeds(config: RunConfig) -> range:
    """Seeds that the race of a tuning may take: after a search, none that its winner was crowned by."""
    if config.model == NO_MODEL:
        return final_seeds(config)
    first = polish_seeds(config).stop
    return range(first, first + config.seeds)


def unused_seed(config: RunConfig) -> int:
    """The first seed after those of a run: neither this seed nor any later one chose anything in the run."""
    return (tuning_seeds(config) if config.tune else polish_seeds(config)).stop


def final_lanes(
    config: RunConfig,
    entries: Iterable[Scored],
    results: Container[str],
    scores: Container[str],
    seeds: Sequence[int] | None = None,
) -> dict[str, list[str]]:
    """Lane ids of the final trainings by reward: those of the candidates, and of each baseline that the run trains.

    A baseline's training beside the first generation counts as well if it has a score: nobody picked it for that.

    Args:
        seeds: fresh seeds to look for; None for all that a run may take.
    """
    wanted = final_seeds(config) if seeds is None else seeds
    fresh = {entry.candidate_id: list(wanted) for entry in entries}
    fresh |= {name: [config.seed, *wanted] for name, _ in trained_baselines(config)}
    return {
        name: [
            lane for seed in own if (lane := lane_id(name, seed)) in results and (seed != config.seed or lane in scores)
        ]
        for name, own in fresh.items()
    }
