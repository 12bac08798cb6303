"""Does an episode without noise tell what a policy has learnt? docs/reference/measurements.md has the answer.

    python benchmarks/noise.py outputs/RUN ...    # every policy of these runs plays both ways, a row a task; minutes
    make docs                                     # the table

In some tasks every episode begins alike. There a policy without noise on its actions plays one episode, however many
are asked for: F is 0 or 1. With the noise of training episodes differ. Nothing was chosen by these start states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import fresh
from choosing import JUDGED
from lanes import by_reward, joined
from ledger import in_sentences
from records import Record, command_line, keep, read, results

import openeureka
from openeureka.config import short_name
from openeureka.numbers import number
from openeureka.stats import defined, mean, pooled, spearman
from openeureka.store import Store
from openeureka.training.evaluate import evaluate

RESULTS = results("noise")
EPISODES = 64
TITLES = (
    "task", "its episodes begin", "policies", "F without noise, mean", "with noise",
    "rank correlation", "0 without noise, above half with it",
    "spread between seeds without noise", "with noise",
)  # fmt: skip


def measure(directory: Path) -> tuple[str, Record]:
    """Let the policies of a run play both ways, of each lane the one at its highest F in training. Returns the task and
    its record, with these added."""
    config = openeureka.open_run(directory).config
    env = config.env
    with Store.view(directory) as store:
        lanes = [path.name for path in sorted((directory / "lanes").iterdir())]
        policies = {lane: data for lane in lanes if (data := store.lanes.policy(lane, "fitness")) is not None}
    scores = [evaluate(env, policies, seed=JUDGED, episodes=EPISODES, noise=noise) for noise in (False, True)]
    played = [{score.lane: score.fitness for score in one} for one in scores]
    both = {lane: [one[lane] for one in played] for lane in policies}
    entry = {**read(RESULTS).get(env, {}), "alike": fresh.noisy(env), "episodes": EPISODES}
    return env, joined(entry, "played", both, config, directory.name)


def between_seeds(played: Mapping[str, Sequence[float | None]], side: int) -> float | None:
    """Standard deviation of F over the seeds of one reward, pooled over rewards with three or more."""
    scores = [defined(pair[side] for pair in seeds.values()) for seeds in by_reward(played).values()]
    several = [values for values in scores if len(values) >= 3]
    return pooled(several)[0] if several else None


def rows(measured: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task."""
    return [_row(env, row) for env, row in measured.items()]


def _row(env: str, row: Record) -> tuple[str, ...]:
    pairs = [pair for pair in row["played"].values() if None not in pair]
    without, noisy = ([pair[side] for pair in pairs] for side in (0, 1))
    missed = sum(not without and noisy > 0.5 for without, noisy in pairs)
    begin = "alike" if row["alike"] else "differently"
    together = number(spearman(without, noisy), 2)
    spreads = [number(between_seeds(row["played"], side), 2) for side in (0, 1)]
    means = number(mean(without)), number(mean(noisy))
    return (short_name(env), begin, str(len(pairs)), *means, together, str(missed), *spreads)


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("directories", type=Path, nargs="+")
    for directory in parser.parse_args().directories:
        with in_sentences():
            env, row = measure(directory)
        keep(RESULTS, env, row)
        print(_row(env, row), flush=True)
