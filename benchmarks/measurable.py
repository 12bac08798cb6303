"""What `observe=measurable` costs in F: the human reward, policies that see all against those that see what a robot's
sensors tell, held out, seed by seed. A table of docs/guides/robot.md.

    python benchmarks/measurable.py              # what is missing, hours on 2 cores
    python benchmarks/measurable.py --env ant    # one task
    python benchmarks/measurable.py --tiny       # minutes, to see that it works

A task is kept in benchmarks/results/measurable.json once it is known. Runs are under outputs/measurable_bench/, and the
same command goes on where it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from intervals import interval_or_dash
from records import OUTPUTS, Record, amount, command_line, machine, once, results, show

import openeureka
from openeureka.numbers import spread
from openeureka.stats import difference, mean
from openeureka.tasks.registry import get

ENVS = ("anymal", "ant", "humanoid")
SIGHTS = ("all", "measurable")
SEEDS = 3
RESULTS = results("measurable")
TITLES = ("task", "steps", "sees all, F held out", "sees what sensors tell", "difference, 95 % interval", "as a share")


def measure(env: str, seeds: int, out: Path, **settings: Any) -> Record:
    """Held-out F by seed, of both kinds of policies."""
    runs = {
        sight: openeureka.train(
            env, "human", observe=sight, seeds=seeds, dir=out / f"{env.partition('+')[0]}_{sight}", **settings
        )
        for sight in SIGHTS
    }
    scores = {sight: list(run.view.given["human"].scores) for sight, run in runs.items()}
    return {"steps": runs["all"].config.steps or get(env).recipe.env_steps, **machine("cpu"), "held_out": scores}


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """One row per task."""
    return [_row(env, measured[env]) for env in ENVS if env in measured]


def _row(env: str, found: Record) -> list[str]:
    everything, sensed = (found["held_out"][sight] for sight in SIGHTS)
    before, after = mean(everything), mean(sensed)
    between = interval_or_dash(difference(sensed, everything), 3)
    share = f"{(after - before) / abs(before):+.0%}" if before and after is not None else "-"
    return [env, f"{found['steps']:,}", spread(everything), spread(sensed), between, share]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", action="append", choices=ENVS, help="a task; may be repeated")
    parser.add_argument("--steps", type=amount, default=0, help="of each training; 0: the task's own")
    parser.add_argument("--tiny", action="store_true", help="short episodes and trainings of one task, kept nowhere")
    options = parser.parse_args()
    if options.tiny:
        tiny = "ant+episode_length=20"
        show(_row(tiny, measure(tiny, 1, OUTPUTS / "measurable_bench" / "tiny", steps=2048, worlds=32)))
        return
    for env in options.env or ENVS:
        train = partial(measure, env, SEEDS, OUTPUTS / "measurable_bench", steps=options.steps)
        found = once(RESULTS, env, train)
        if options.steps not in (0, found["steps"]):
            print(f"{env} is known with {found['steps']:,} steps, and not trained again.")
        show(_row(env, found))


if __name__ == "__main__":
    main()
