"""What policies score that never trained: F held out, for each row of docs/reference/headline.md. A reward is shown to
teach something where its policies do better.

    python benchmarks/untrained.py              # the rows that lack it, half an hour on 2 cores
    python benchmarks/untrained.py --env ant    # one task

They have the initial weights of the seeds that decide the row, or of `SEEDS` where the race decides. They play as its
policies do: in the same episodes, with noise where those had it. The scores are kept in the rows of
`benchmarks/results/headline.json`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import table
import torch
from records import Record, command_line, keep, machine, read, show

from openeureka.config import short_name
from openeureka.numbers import spread
from openeureka.tasks import registry
from openeureka.training.evaluate import evaluate
from openeureka.training.policy import Policy
from openeureka.training.ppo import PPO

SEEDS = 6
"""Enough for three seeds that all succeed to differ from as many as these that all fail."""


def left(measured: Mapping[str, Record]) -> Iterator[str]:
    """The tasks whose row lacks it, or has come to be decided by other seeds."""
    return (env for env, row in table.ordered(measured) if not table.beginners(row))


def measure(env: str, row: Record, episodes: int = 0) -> Record:
    """F held out by seed. Without noise, where all episodes begin alike, F is that of one episode."""
    first, again = row["seed"], row.get("confirmed") or {}
    seeds = again.get("seeds") or [*range(first, first + SEEDS)]  # the first one also draws the start states
    policies = {f"s{seed}": _untrained(env, seed) for seed in seeds}
    scores = evaluate(env, policies, seed=seeds[0], episodes=episodes, noise=table.noisy(row))
    return {"seeds": seeds, "noisy": table.noisy(row), "scores": [score.fitness for score in scores], **machine("cpu")}


def _untrained(env: str, seed: int) -> bytes:
    task = registry.get(env)
    ppo = PPO([seed], task.num_observations, task.num_actions, task.recipe, torch.device("cpu"))
    return Policy.of(env, ppo, 0).to_bytes()


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", nargs="+", choices=sorted(read(table.RESULTS)))
    options = parser.parse_args()
    for env in options.env or [*left(read(table.RESULTS))]:
        row = read(table.RESULTS)[env]
        keep(table.RESULTS, env, row | {"untrained": measure(env, row)})
        row = read(table.RESULTS)[env]
        show([short_name(env), spread(row["untrained"]["scores"]), table.ending(row)])


if __name__ == "__main__":
    main()
