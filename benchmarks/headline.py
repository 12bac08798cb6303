"""A strong model's rewards against the human ones, task by task: docs/reference/headline.md.

    python benchmarks/headline.py              # what is missing of benchmarks/plans/headline.yaml; hours to days
    python benchmarks/headline.py --env ant    # one task
    python benchmarks/headline.py --left       # what is missing, and about how long it will take
    python benchmarks/headline.py --again ant  # repeats a row that is known, and says whether it is the same
    python benchmarks/headline.py --confirm 9 --env ant
                                               # nine more seeds of the generated reward and the human one
    python benchmarks/headline.py --confirm 9 --steps 3e6 --env shadow_hand_kettle
                                               # the same, trained longer than the row was

A row is a search from committed replies: eight rewards, the human and the sparse one train, the leading rewards race
with fresh seeds, and the winner is judged in held-out episodes. What a search found is kept: figures in
`benchmarks/results/headline.json`, the winner in `benchmarks/headline/rewards/TASK.py`, and the store of its run in
`benchmarks/headline/TASK.sqlite.xz`, from which the page and the report of the run can be made again. Runs are under
`outputs/headline/`; one that was killed goes on.
"""

from __future__ import annotations

import lzma
import shutil
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import fresh
import table
from intervals import ends, interval
from ledger import Script
from records import OUTPUTS, ROOT, Record, amount, command_line, keep, machine, read, results

from openeureka.benchmark import bench
from openeureka.benchmark.figures import Result
from openeureka.benchmark.plan import Plan, load
from openeureka.config import short_name
from openeureka.llm.replay import archived
from openeureka.report.view import RunView
from openeureka.store.db import FILENAME

BASELINES = results("baselines")
GREEDY = results("greedy")
AGAIN = OUTPUTS / "headline_again"
CONFIRMED = OUTPUTS / "headline_confirmed"
TRAININGS = 20
"""Lanes of a row, about: ten in the search, and three fresh seeds of what races."""

NOT_REPEATED = ("minutes", "date", "device", "processor", "versions")
"""What differs in a repeated measurement."""


def measure(plan: Plan, env: str) -> None:
    """Search on one task, or go on with it, and keep what it found."""
    store, row = search(plan, env, OUTPUTS / "headline" / env)
    put_away(store, table.ARCHIVE, env)
    publish(env)
    keep(table.RESULTS, env, row)


def repeat(plan: Plan, env: str) -> str:
    """Measure a row again, and say what is the same: all, on the same kind of processor with the same versions. Where
    the search played without noise and policies play with noise today, only the seeds that decide the row train again.

    Raises:
        SystemExit: where no seeds of the row played as policies do today.
    """
    if any((AGAIN / env).rglob("report.html")):  # a finished one would be taken as it is
        shutil.rmtree(AGAIN / env)
    row = read(table.RESULTS)[env]
    if not fresh.noisy(env):
        return compared(env, row, search(plan, env, AGAIN / env)[1])
    known, run = row.get("confirmed") or {}, archived_run(env)
    if not fresh.as_today(known, env):
        raise SystemExit(
            f"{env}: this row can't be repeated. Its policies played without noise, and today they play with noise. "
            f"Train its reward instead: {table.reward_file(env).relative_to(ROOT)}"
        )
    assert run.best is not None
    config = replace(run.config, steps=known.get("steps", row["steps"]))
    trained = fresh.trained(config, ["human", run.best.program.source], AGAIN / env, len(known["seeds"]))
    human, generated = trained.scores
    again = {"seeds": trained.seeds, "generated": generated, "human": human}
    return compared(f"{env}, {len(known['seeds'])} other seeds", known, again)


def search(plan: Plan, env: str, directory: Path) -> tuple[Path, Record]:
    """The store of a finished search on one task, and what came of it."""
    (cell,) = (cell for cell in plan.cells() if cell.task == env)
    one = replace(plan, tasks=(env,), per_task={env: plan.per_task[env]})
    found: list[bench.Bench] = []
    bench.run(one, directory, Script(), found.append, print)
    for name, error in found[-1].failures.items():
        raise SystemExit(f"{name}: {error}")
    (result,) = found[-1].results
    return directory / cell.name / FILENAME, outcome(directory / cell.name, result)


def put_away(store: Path, folder: Path, env: str) -> None:
    """Keep the store of a search, packed, in a folder of the repository."""
    folder.mkdir(exist_ok=True)
    (folder / f"{env}.sqlite.xz").write_bytes(lzma.compress(portable(store), preset=9))


def publish(env: str) -> None:
    """Write the winner of an archived search as a file, to read and to train."""
    best = archived_run(env).best
    assert best is not None
    table.REWARDS.mkdir(exist_ok=True)
    table.reward_file(env).write_text(best.program.source)


def portable(store: Path) -> bytes:
    """The store with the path of its file of replies made relative to the repository, as another clone needs it."""
    with TemporaryDirectory() as folder:
        copy = shutil.copy(store, folder)
        with closing(sqlite3.connect(copy, isolation_level=None)) as database:
            (guard,) = database.execute("SELECT sql FROM sqlite_master WHERE name = 'run_UPDATE'").fetchone()
            database.execute("DROP TRIGGER run_UPDATE")
            database.execute("UPDATE run SET config = replace(config, ?, '')", (f"{ROOT}/",))
            database.execute(guard)
            database.execute("VACUUM")
        return Path(copy).read_bytes()


def train_other_seeds(env: str, count: int, steps: int = 0) -> Record:
    """Train the row's reward and the human one with seeds that chose neither. What `greedy.py` trained is reused.

    Args:
        steps: of each training; 0 means those of the row.
    """
    run, known = archived_run(env), read(GREEDY).get(env, {})
    assert run.best is not None
    longer = {"steps": steps} if steps not in (0, run.config.steps) else {}
    reused = not longer and known.get("best") == str(run.best.place) and fresh.reusable(known, env, count)
    rewards = ["human"] if reused else ["human", run.best.program.source]
    directory = CONFIRMED / (f"{env}_{steps}" if longer else env)
    trained = fresh.trained(replace(run.config, **longer), rewards, directory, count)
    human, generated = (*trained.scores, known["own"]) if reused else trained.scores
    return longer | confirmation(trained, human, generated) | ({"generated_on": known["processor"]} if reused else {})


def confirm(env: str, count: int, steps: int = 0) -> str:
    """What other seeds say of a row. They are trained where there are none, or where theirs lack the task's noise or
    some of the steps. Shorter trainings stay in the row, and decide it no more.
    """
    row = read(table.RESULTS)[env]
    known = row.get("confirmed") or {}
    played = bool(known) and fresh.as_today(known, env)
    if not played or steps > known.get("steps", row["steps"]):
        earlier = {"shorter": [*row.get("shorter", ()), known]} if played else {}
        known = train_other_seeds(env, count, steps)
        keep(table.RESULTS, env, row | earlier | {"confirmed": known})
    return f"{short_name(env)}, known with {len(known['seeds'])} seeds: {interval(*known['difference'], digits=3)}"


def confirmation(trained: fresh.Trained, human: Sequence[float], generated: Sequence[float]) -> Record:
    """What trainings with other seeds say of a row."""
    scores = {"generated": generated, "human": human, "difference": fresh.between(human, generated)}
    return {"seeds": trained.seeds, **scores, **({"noisy": True} if trained.noisy else {}), **machine("cpu")}


def archived_run(env: str, folder: Path = table.ARCHIVE) -> RunView:
    """The search of a row."""
    with TemporaryDirectory() as directory:
        (Path(directory) / FILENAME).write_bytes(lzma.decompress((folder / f"{env}.sqlite.xz").read_bytes()))
        return RunView.read(Path(directory))


def outcome(directory: Path, result: Result) -> Record:
    """What came of a finished search."""
    run = RunView.read(directory)
    found = run.outcome
    assert found is not None and run.best is not None
    return {
        "model": archived(Path(run.config.model.removeprefix("replay:")))[0].model,
        "steps": run.config.steps,
        "all_steps": result.steps,
        "minutes": round(result.minutes, 1),
        **machine(run.config.device),
        "seed": result.seed,
        "crowned": str(run.best.place),
        "generated": list(found.method.held_out),
        "runners_up": {str(place): list(own.held_out) for place, own in found.rivals.items()},
        "human": list(found.human.held_out),
        "sparse": list(found.sparse.held_out),
        "difference": ends(found.difference),
        "score": found.normalised,
        "correlation_with_human": found.correlation,
    }


def compared(env: str, kept: Record, again: Record) -> str:
    """How a repetition compares with its row: one sentence, or a line per difference."""
    other = [name for name in again if name not in NOT_REPEATED and again[name] != kept.get(name)]
    if not other:
        return f"{env}: every number is the same to the bit."
    lines = [f"  {name}: {again[name]}, the table has {kept.get(name)}" for name in other]
    where = ", ".join(
        [kept["device"], kept.get("processor", "a processor that nobody wrote down"), str(kept["versions"])]
    )
    return "\n".join([f"{env}: not the same. The table was measured on {where}.", *lines])


def left(measured: Mapping[str, Record]) -> str:
    """The missing tasks, a line each, with the time that they will take, estimated from their baselines."""
    plan, known, total, lines = load(table.PLAN), read(BASELINES), 0.0, list[str]()
    for env in (env for env in plan.tasks if env not in measured):
        trained = next(iter(known[env]["lanes"].values()))
        took = trained["training"]["minutes"] / (trained["training"]["lanes"] * trained["env_steps"])
        minutes = TRAININGS * plan.per_task[env]["steps"] * took
        total += minutes
        lines.append(f"{short_name(env):<32} {minutes / 60:5.1f} h")
    return "\n".join([*lines, f"{len(lines)} tasks, {total / 60:.0f} h"])


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", nargs="+", choices=load(table.PLAN).tasks, metavar="TASK", help="of the plan")
    parser.add_argument("--left", action="store_true")
    parser.add_argument("--again", choices=sorted(read(table.RESULTS)), nargs="+", help="rows that are known")
    parser.add_argument(
        "--confirm", type=fresh.several, default=0, metavar="SEEDS", help="more seeds for rows that are known"
    )
    parser.add_argument("--steps", type=amount, default=0, help="of each of their trainings, if not the row's")
    options = parser.parse_args()
    plan = load(table.PLAN)
    if options.left:
        print(left(read(table.RESULTS)))
    elif options.again:
        for env in options.again:
            print(repeat(plan, env), flush=True)
    elif options.confirm:
        if unknown := [env for env in options.env or () if env not in read(table.RESULTS)]:
            parser.error(f"{unknown[0]} has no row yet: without --confirm it is measured.")
        for env in options.env or read(table.RESULTS):
            print(confirm(env, options.confirm, options.steps), flush=True)
        print(table.summary(read(table.RESULTS)))
    else:
        for env in options.env or plan.tasks:
            if env not in read(table.RESULTS):
                measure(plan, env)
        print(table.summary(read(table.RESULTS)))
