"""Where eight rewards ended below the human one: what do two more generations find? See docs/reference/headline.md.

    python benchmarks/longer.py              # what is missing of benchmarks/plans/longer.yaml; hours on 2 cores
    python benchmarks/longer.py --env ant    # one task

The first eight replies are those of the table's row, the others answer the prompts that this search made of them. A
search stops where its replies end: the last prompt of its `messages.json` is the one that the next eight must answer.
With them in the file of replies, the same command goes on. In the end the reward it finds and the human one train with
nine seeds that chose neither. Runs are under `outputs/longer/`; the store of each is kept in
`benchmarks/longer/TASK.sqlite.xz`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import fresh
import headline
import table
from intervals import interval
from records import FOLDER, OUTPUTS, Record, command_line, once, read, results

from openeureka.benchmark.plan import Plan, load
from openeureka.config import RunConfig, short_name
from openeureka.numbers import spread
from openeureka.score import rank
from openeureka.stats import mean

PLAN = FOLDER / "plans" / "longer.yaml"
ARCHIVE = FOLDER / "longer"
RESULTS = results("longer")
SEEDS = 9


def titles(first: str, later: str) -> tuple[str, ...]:
    """Of the columns of `rows`, for a search of the table and a later one."""
    return (
        "task", f"{first}, F held out", "human", later, "human",
        "difference, 95 % interval", "the later one is", "crowned",
    )  # fmt: skip


TITLES = titles("one generation", "three generations")


def measure(plan: Plan, env: str, archive: Path = ARCHIVE) -> Record:
    """Search on one task, or go on with it, and train what it found with other seeds."""
    row, config, own = searched(plan, env, archive)
    trained = train_again(config, ["human", own], env, archive)
    return row | {"confirmed": headline.confirmation(trained, *trained.scores)}


def searched(plan: Plan, env: str, archive: Path) -> tuple[Record, RunConfig, str]:
    """What came of a search, whose store is kept; its settings and the program that won."""
    store, row = headline.search(plan, env, OUTPUTS / archive.name / env)
    headline.put_away(store, archive, env)
    run = headline.archived_run(env, archive)
    assert run.best is not None
    return row, run.config, run.best.program.source


def train_again(config: RunConfig, rewards: Sequence[str], env: str, archive: Path) -> fresh.Trained:
    """Train rewards with nine seeds that chose none of them."""
    return fresh.trained(config, rewards, OUTPUTS / f"{archive.name}_confirmed" / env, SEEDS)


def left(measured: Mapping[str, Record], plan: Path = PLAN) -> list[str]:
    """The tasks that are not measured."""
    return [env for env in load(plan).tasks if env not in measured]


def rows(measured: Mapping[str, Record], plan: Path = PLAN) -> list[list[str]]:
    """One row per task: what decides its row of the table, and what the later search found. Intervals hold together."""
    known, tasks, found = read(table.RESULTS), load(plan).tasks, list[list[str]]()
    for env in (env for env in tasks if env in measured):
        first, later = table.decided(known[env]), _decisive(env, measured[env], known)
        later |= {"difference": fresh.between(later["human"], later["generated"], claims=len(tasks))}
        scores = (spread(row[name]) for row in (first, later) for name in ("generated", "human"))
        ends = interval(*later["difference"], digits=3), table.ending(later), later["crowned"]
        found.append([short_name(env), *scores, *ends])
    return found


def _decisive(env: str, row: Record, known: Mapping[str, Record]) -> Record:
    """The scores that decide a later search, beside those that no training has."""
    return table.decided(row) | {"confirmed": None, "untrained": known.get(env, {}).get("untrained")}


def summary(measured: Mapping[str, Record]) -> str:
    """How many are at or above the human reward now; nothing before one is measured."""
    return f"After three generations, {reached(measured)}" if measured else ""


def reached(measured: Mapping[str, Record]) -> str:
    """How many of the later searches are at or above the human reward: the end of a sentence."""
    known = read(table.RESULTS)
    decisive = [_decisive(env, row, known) for env, row in measured.items()]
    learnt = [row for row in decisive if table.ending(row) != "nothing learnt"]
    above = sum(rank(mean(row["generated"])) >= rank(mean(row["human"])) for row in learnt)
    told = f"the generated reward is at or above the human one on {above} of {len(learnt)} tasks"
    idle = len(decisive) - len(learnt)
    return f"{told}; on {idle} more neither is shown to do better than no training." if idle else f"{told}."


def run(
    doc: str | None,
    plan: Path,
    archive: Path,
    kept: Path,
    measure: Callable[[Plan, str, Path], Record] = measure,
) -> None:
    """Measure what the command line asks for and the file `kept` lacks."""
    parser = command_line(doc)
    parser.add_argument("--env", nargs="+", choices=load(plan).tasks)
    options = parser.parse_args()
    for env in options.env or load(plan).tasks:
        once(kept, env, partial(measure, load(plan), env, archive))


if __name__ == "__main__":
    run(__doc__, PLAN, ARCHIVE, RESULTS)
    print(summary(read(RESULTS)))
