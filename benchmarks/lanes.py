"""Trainings in the JSON of records.py: what a lane came to, and the lanes of several runs side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

from records import Record, machine

from openeureka.config import RunConfig
from openeureka.types import Evaluation, Peak, TrainingResult

PEAKS: tuple[Peak, ...] = ("fitness", "reward")
"""The policies whose held-out F stands in a record of a lane."""
POINTS = 40  # of each curve in a file
Lane = TypeVar("Lane")


def record(result: TrainingResult, held_out: Mapping[Peak, Evaluation]) -> Record:
    """A lane as JSON, with the held-out scores of the policies at both peaks.

    `fitness_at_first` is F of the first episodes that end, under a policy that explores and has hardly trained.
    """
    return {
        "state": str(result.state),
        "message": result.message,
        "env_steps": result.env_steps,
        "fitness_at_first": next((f for f in result.curves.get("fitness", ()) if f is not None), None),
        "fitness_max_over_epochs": result.fitness,
        "held_out_at_peak_of_fitness": _score(held_out.get("fitness")),
        "held_out_at_peak_of_reward": _score(held_out.get("reward")),
        "correlation_with_human": result.correlation,
        "curves": thinned(result.curves),
    }


def _score(held_out: Evaluation | None) -> Record:
    return {
        "fitness": held_out.fitness if held_out else None,
        "episode_length": held_out.episode_length if held_out else None,
    }


def thinned(curves: Mapping[str, Sequence[float | None]]) -> dict[str, list[float | None]]:
    """Evenly spaced points of the most telling curves."""
    shown = {name: curves[name] for name in ("fitness", "episode_length", "reward") if name in curves}
    return {
        name: [None if value is None else round(value, 4) for value in curve[:: max(1, -(-len(curve) // POINTS))]]
        for name, curve in shown.items()
    }


def reward_and_seed(lane: str) -> tuple[str, int]:
    """What a lane's id is made of, see `lane_id`."""
    reward, _, seed = lane.rpartition("-s")
    return reward, int(seed)


def by_reward(lanes: Mapping[str, Lane]) -> dict[str, dict[int, Lane]]:
    """What is known of lanes, by reward and seed."""
    found: dict[str, dict[int, Lane]] = {}
    for lane, known in lanes.items():
        reward, seed = reward_and_seed(lane)
        found.setdefault(reward, {})[seed] = known
    return found


def joined(entry: Record, key: str, lanes: Record, config: RunConfig, name: str) -> Record:
    """A task's record with the lanes and the settings of one more run.

    Args:
        key: under which the record holds its lanes.
        lanes: of the run `name`.

    Raises:
        SystemExit: where another run has a different lane of the same id.
    """
    known, runs = entry.get(key, {}), entry.get("runs", {})
    own = runs.get(name, {}).get("lanes", ())
    if others := [lane for lane in lanes if lane in known and lane not in own and known[lane] != lanes[lane]]:
        raise SystemExit(f"{name} has another {others[0]} than the results, so its lanes cannot join them.")
    settings = {word: getattr(config, word) for word in ("model", "seed", "steps", "worlds", "schedule")}
    run = {**settings, **machine(config.device), "lanes": list(lanes)}
    return {**entry, key: {**known, **lanes}, "runs": {**runs, name: run}}


def rounded(value: float | None) -> float | None:
    """To five digits."""
    return None if value is None else float(f"{value:.5g}")
