"""Where all episodes begin alike: do searches that play with noise choose better? See docs/reference/headline.md.

    python benchmarks/with_noise.py                                # what is missing of benchmarks/plans/with_noise.yaml
    python benchmarks/with_noise.py --env shadow_hand_push_block   # one task

The searches of the table played these 14 tasks without noise. Here the same eight rewards are searched through again,
on all 14 tasks, however their row ended. The reward that wins trains with nine seeds that chose nothing. The human
reward has trained with these seeds for the table, unless it played without noise there. Runs are under
`outputs/with_noise/`; the store of each is kept in `benchmarks/with_noise/TASK.sqlite.xz`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import headline
import longer
import table
from records import FOLDER, Record, read, results

from openeureka.benchmark.plan import Plan

PLAN = FOLDER / "plans" / "with_noise.yaml"
ARCHIVE = FOLDER / "with_noise"
RESULTS = results("with_noise")
TITLES = longer.titles("searched without noise", "searched with noise")
left = partial(longer.left, plan=PLAN)
rows = partial(longer.rows, plan=PLAN)


def measure(plan: Plan, env: str, archive: Path = ARCHIVE) -> Record:
    """Search on one task, or go on with it, and train what it found with other seeds."""
    row, config, own = longer.searched(plan, env, archive)
    known, first = played_with_noise(read(table.RESULTS)[env]), headline.archived_run(env).best
    if known is None:
        trained = longer.train_again(config, ["human", own], env, archive)
        return row | {"confirmed": headline.confirmation(trained, *trained.scores)}
    assert first is not None
    if own == first.program.source:
        return row | {"confirmed": known}
    trained = longer.train_again(config, [own], env, archive)
    confirmation = headline.confirmation(trained, known["human"], trained.scores[0])
    return row | {"confirmed": confirmation | {"human_on": known["processor"]}}


def played_with_noise(row: Record) -> Record | None:
    """What other seeds say of a row of the table, for as many steps as its search, if they played with noise."""
    alike = (again for again in table.confirmations(row) if again.get("noisy") and "steps" not in again)
    return next(alike, None)


def summary(measured: Mapping[str, Record]) -> str:
    """How many are at or above the human reward now; nothing before one is measured."""
    return f"With noise, {longer.reached(measured)}" if measured else ""


if __name__ == "__main__":
    longer.run(__doc__, PLAN, ARCHIVE, RESULTS, measure)
    print(summary(read(RESULTS)))
