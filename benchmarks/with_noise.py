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
from pathlib import Path

import fresh
import headline
import longer
import table
from records import FOLDER, OUTPUTS, Record, read, results

from openeureka.benchmark.plan import Plan

PLAN = FOLDER / "plans" / "with_noise.yaml"
ARCHIVE = FOLDER / "with_noise"
RESULTS = results("with_noise")
TITLES = (
    "task", "searched without noise, F held out", "human", "searched with noise", "human",
    "difference, 95 % interval", "the later one is", "crowned",
)  # fmt: skip


def measure(whole: Plan, env: str, archive: Path = ARCHIVE) -> Record:
    """Search on one task, or go on with it, and train what it found with other seeds."""
    store, row = headline.search(whole, env, OUTPUTS / archive.name / env)
    headline.put_away(store, archive, env)
    run, known = headline.archived_run(env, archive), played_with_noise(read(table.RESULTS)[env])
    first = headline.archived_run(env)
    assert run.best is not None and first.best is not None
    own = run.best.program.source
    if known and own == first.best.program.source:
        return row | {"confirmed": known}
    rewards = [own] if known else ["human", own]
    trained = fresh.trained(run.config, rewards, OUTPUTS / f"{archive.name}_confirmed" / env, longer.SEEDS)
    human = known["human"] if known else trained.scores[0]
    human_on = {"human_on": known["processor"]} if known else {}
    return row | {"confirmed": headline.confirmation(trained, human, trained.scores[-1]) | human_on}


def played_with_noise(row: Record) -> Record | None:
    """What other seeds say of a row of the table, for as many steps as its search, if they played with noise."""
    alike = (again for again in table.confirmations(row) if again.get("noisy") and "steps" not in again)
    return next(alike, None)


def left(measured: Mapping[str, Record]) -> list[str]:
    """The tasks that are not measured."""
    return longer.left(measured, PLAN)


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """As `longer.rows`."""
    return longer.rows(measured, PLAN)


def summary(measured: Mapping[str, Record]) -> str:
    """How many are at or above the human reward now; nothing before one is measured."""
    return f"With noise, {longer.reached(measured)}" if measured else ""


if __name__ == "__main__":
    longer.run(__doc__, PLAN, ARCHIVE, RESULTS, measure)
    print(summary(read(RESULTS)))
