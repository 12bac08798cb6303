"""A strong model's rewards against the human ones, task by task: docs/reference/headline.md.

    python benchmarks/headline.py              # what is missing of benchmarks/plans/headline.yaml; hours to days
    python benchmarks/headline.py --env ant    # one task
    python benchmarks/headline.py --left       # what is missing, and about how long it will take
    python benchmarks/headline.py --again ant  # repeats a row that is known, and says whether it is the same
    python benchmarks/headline.py --confirm 9 --env ant
                                               # nine more seeds of the generated reward and the human one

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
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import fresh
from ledger import Script
from records import FOLDER, OUTPUTS, ROOT, Record, command_line, interval, keep, machine, read, results

from openeureka.benchmark import bench
from openeureka.benchmark.plan import Cell, Plan, load
from openeureka.config import short_name
from openeureka.llm.registry import archived
from openeureka.numbers import number, spread
from openeureka.report.view import RunView
from openeureka.score import clipped, plainly_normalised, rank
from openeureka.stats import difference, mean, two_valued
from openeureka.store.db import FILENAME

PLAN = FOLDER / "plans" / "headline.yaml"
ARCHIVE = FOLDER / "headline"
REWARDS = ARCHIVE / "rewards"
RESULTS = results("headline")
BASELINES = results("baselines")
GREEDY = results("greedy")
AGAIN = OUTPUTS / "headline_again"
CONFIRMED = OUTPUTS / "headline_confirmed"
TRAININGS = 20
"""Lanes of a row, about: ten in the search, and three fresh seeds of what races."""

TITLES = (
    *("task", "steps", "generated, F held out", "human", "sparse"),
    *("generated minus human, 95 % interval", "the generated one is", "score", "clipped", "correlation"),
)
ENDINGS = {
    "better": "better than the human one",
    "level": "level with it: no difference shown",
    "worse": "worse",
    "too few seeds": "not decided: three seeds are too few to tell",
    "both at zero": "not decided: both score zero",
    "one seed": "not decided: one seed",
}
NOT_REPEATED = ("minutes", "date", "device", "processor", "versions", "confirmed")
"""What differs in a repeated search, or is missing there."""
COLUMNS = "task", "steps", "seeds", "noise", "reward", "candidate", "seed", "f_held_out"


def measure(whole: Plan, env: str) -> None:
    """Search on one task, or go on with it, and keep what it found."""
    store, row = search(whole, env, OUTPUTS / "headline" / env)
    put_away(store, ARCHIVE, env)
    publish(env)
    keep(RESULTS, env, row)


def repeat(whole: Plan, env: str) -> str:
    """Search on a task again, and say what is the same: all, on the same kind of processor with the same versions."""
    if any((AGAIN / env).glob("*/report.html")):  # a finished one would be taken as it is
        shutil.rmtree(AGAIN / env)
    _, again = search(whole, env, AGAIN / env)
    return compared(env, read(RESULTS)[env], again)


def search(whole: Plan, env: str, directory: Path) -> tuple[Path, Record]:
    """The store of a finished search on one task, and what came of it."""
    (cell,) = (cell for cell in whole.cells() if cell.task == env)
    one = replace(whole, tasks=(env,), per_task={env: whole.per_task[env]})
    found: list[bench.Bench] = []
    bench.run(one, directory, Script(), found.append, print)
    for name, error in found[-1].failures.items():
        raise SystemExit(f"{name}: {error}")
    store = directory / cell.name / FILENAME
    return store, outcome(store.parent, cell, found[-1])


def put_away(store: Path, archive: Path, env: str) -> None:
    """Keep the store of a search, packed, in a folder of the repository."""
    archive.mkdir(exist_ok=True)
    (archive / f"{env}.sqlite.xz").write_bytes(lzma.compress(portable(store), preset=9))


def publish(env: str) -> None:
    """Write the winner of an archived search as a file, to read and to train."""
    best = archive(env).best
    assert best is not None
    REWARDS.mkdir(exist_ok=True)
    reward(env).write_text(best.program.source)


def reward(env: str) -> Path:
    """The file of a task's winner."""
    return REWARDS / f"{short_name(env)}.py"


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


def confirm(env: str, count: int) -> Record:
    """Train the row's reward and the human one with seeds that chose neither. What `greedy.py` trained is reused."""
    run, known = archive(env), read(GREEDY).get(env, {})
    assert run.best is not None
    same = known.get("best") == str(run.best.place) and known.get("noisy", False) == fresh.noisy(env)
    again = same and len(known.get("seeds", ())) == count
    rewards = ["human"] if again else ["human", run.best.program.source]
    trained = fresh.trained(run.config, rewards, CONFIRMED / env, count)
    human, generated = (*trained.scores, known["own"]) if again else trained.scores
    return look(trained, human, generated) | ({"generated_on": known["processor"]} if again else {})


def confirmed(env: str, count: int) -> str:
    """What other seeds say of a row. They are trained where there are none, or where theirs lack the task's noise."""
    row = read(RESULTS)[env]
    known = row.get("confirmed")
    if known is None or (not known.get("noisy") and fresh.noisy(env)):
        known = confirm(env, count)
        keep(RESULTS, env, row | {"confirmed": known})
    return f"{short_name(env)}, known with {len(known['seeds'])} seeds: {interval(*known['difference'], digits=3)}"


def look(trained: fresh.Trained, human: Sequence[float], generated: Sequence[float]) -> Record:
    """What trainings with other seeds say of a row."""
    scores = {"generated": generated, "human": human, "difference": fresh.between(human, generated)}
    return {"seeds": trained.seeds, **scores, **({"noisy": True} if trained.noisy else {}), **machine("cpu")}


def archive(env: str, archive: Path = ARCHIVE) -> RunView:
    """The search of a row."""
    with TemporaryDirectory() as folder:
        (Path(folder) / FILENAME).write_bytes(lzma.decompress((archive / f"{env}.sqlite.xz").read_bytes()))
        return RunView.read(Path(folder))


def outcome(directory: Path, cell: Cell, found: bench.Bench) -> Record:
    """What came of a finished search."""
    run, (result,) = RunView.read(directory), found.results
    ends = run.outcome
    assert ends is not None and run.best is not None
    apart = ends.difference
    return {
        "model": archived(Path(run.config.model.removeprefix("replay:")))[0].model,
        "steps": run.config.steps,
        "all_steps": result.steps,
        "minutes": round(result.minutes, 1),
        **machine(run.config.device),
        "seed": cell.seed,
        "crowned": str(run.best.place),
        "generated": list(ends.method.held_out),
        "runners_up": {str(place): list(own.held_out) for place, own in ends.rivals.items()},
        "human": list(ends.human.held_out),
        "sparse": list(ends.sparse.held_out),
        "difference": [apart.value, apart.low, apart.high] if apart is not None else None,
        "score": ends.normalised,
        "correlation_with_human": ends.correlation,
    }


def compared(env: str, kept: Record, again: Record) -> str:
    """How a repetition compares with its row: one sentence, or a line per difference."""
    other = [name for name in kept if name not in NOT_REPEATED and again[name] != kept[name]]
    if not other:
        return f"{env}: every number is the same to the bit."
    lines = [f"  {name}: {again[name]}, the table has {kept[name]}" for name in other]
    where = ", ".join(
        [kept["device"], kept.get("processor", "a processor that nobody wrote down"), str(kept["versions"])]
    )
    return "\n".join([f"{env}: not the same. The table was measured on {where}.", *lines])


def decided(row: Record) -> Record:
    """The row with the scores that decide it: those of seeds that chose nothing, where there are any."""
    return row | row["confirmed"] | {"runners_up": {}} if row.get("confirmed") else row


def ending(row: Record) -> str:
    """How a row ends; a tie of zeros is undecided, as it says nothing of either reward."""
    row = decided(row)
    values = [value for name in ("generated", "human") for value in row[name] if value is not None]
    if not any(values):
        return "both at zero"
    if row["difference"] is None:
        return "one seed"
    _, low, high = row["difference"]
    return "better" if low > 0 else "worse" if high < 0 else "level" if decidable(row) else "too few seeds"


def decidable(row: Record) -> bool:
    """Whether so few seeds can decide. Where F has two values they may not: even all against none can be chance."""
    own, human, *among = (
        _defined(own) for own in (row["generated"], row["human"], *row.get("runners_up", {}).values())
    )
    if not two_valued([*own, *human]):
        return True
    low, high = min(*own, *human), max(*own, *human)
    if low == high:
        low, high = 0.0, 1.0
    split = difference([high] * len(own), [low] * len(human), among, claims=1 + len(among))
    return split is not None and split.low > 0


def _defined(scores: Sequence[float | None]) -> list[float]:
    return [score for score in scores if score is not None]


def ordered(measured: Mapping[str, Record]) -> Iterator[tuple[str, Record]]:
    """Tasks and rows, in the order of the plan."""
    return ((env, measured[env]) for env in load(PLAN).tasks if env in measured)


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """One row per task, in the order of the plan. Where its reward trained again, the row below has the seeds that
    chose nothing.
    """
    found: list[list[str]] = []
    for env, row in ordered(measured):
        name, again = short_name(env), row.get("confirmed")
        first = f"[{name}](../../{reward(env).relative_to(ROOT)})", f"{row['steps']:,}", *_scores(row, row["sparse"])
        found.append([*first, number(row["correlation_with_human"], 2)])
        if again is not None:
            how = " that play with noise" if again.get("noisy") else ""
            title = f"{name}, {len(again['seeds'])} other seeds{how}"
            sparse = [] if again.get("noisy") else row["sparse"]  # it played without noise
            found.append([title, "", *_scores(again, sparse), ""])
    return found


def _scores(row: Record, sparse: Sequence[float | None]) -> tuple[str, ...]:
    between = interval(*row["difference"], digits=3) if row["difference"] is not None else "-"
    scores = row["generated"], row["human"], sparse
    score = plainly_normalised(*map(mean, scores))
    return *map(spread, scores), between, ending({**row, "confirmed": {}}), number(score, 3), number(clipped(score), 3)


def differences(measured: Mapping[str, Record]) -> Iterator[tuple[str, Record]]:
    """The decisive scores of the rows that have a difference, in the order of the plan."""
    known = ((short_name(env), decided(row)) for env, row in ordered(measured))
    return ((name, row) for name, row in known if row["difference"] is not None)


def gains(measured: Mapping[str, Record]) -> list[tuple[str, str, float, float, float]]:
    """One row per task whose rewards do not both score zero: how it ended, and the difference and its interval, as
    shares of the larger F."""
    found = []
    for name, row in differences(measured):
        if largest := max(abs(mean(row[name]) or 0.0) for name in ("generated", "human")):
            value, low, high = (end / largest for end in row["difference"])
            found.append((name, ending(row), value, low, high))
    return found


def novelty(measured: Mapping[str, Record]) -> list[tuple[str, str, float, float]]:
    """One row per task whose rewards do not both score zero: how it ended, correlation with the human reward, and the
    difference in units of half its interval: beyond 1 it is decided. Differences without a spread are left out."""
    found = []
    for name, row in differences(measured):
        (value, _, high), how = row["difference"], ending(row)
        if how != "both at zero" and (high > value or not value):
            found.append((name, how, row["correlation_with_human"], value / (high - value) if value else 0.0))
    return found


def endings(measured: Mapping[str, Record]) -> list[tuple[str, str]]:
    """How many rows end which way."""
    ends = Counter(map(ending, measured.values()))
    missing = len(load(PLAN).tasks) - len(measured)
    counts = [*((name, ends[how]) for how, name in ENDINGS.items()), ("not measured yet", missing)]
    return [(name, str(count)) for name, count in counts if count]


def summary(measured: Mapping[str, Record]) -> str:
    """The rows in a few sentences. Means of seeds that chose nothing are counted apart from those that picked the
    winner."""
    ends = Counter(map(ending, measured.values()))
    unknown = f" On {ends['one seed']} it is not known, as one seed trained." if ends["one seed"] else ""
    decisive = [row for row in measured.values() if ending(row) != "both at zero"]
    other = [decided(row) for row in decisive if row.get("confirmed")]
    picked = [row for row in decisive if not row.get("confirmed")]
    return (
        f"{len(measured)} of {len(load(PLAN).tasks)} tasks are measured. The generated reward is better than the human "
        f"one on {ends['better']} tasks, level on {ends['level']}, worse on {ends['worse']}. Three seeds are too few "
        f"to tell on {ends['too few seeds']} tasks. Both rewards score zero on {ends['both at zero']}.{unknown}\n"
        f"{len(other)} tasks trained again with seeds that chose nothing. There the generated reward's mean is "
        f"{_means(other)}. On {len(picked)} more tasks the same seeds picked the reward and score it. There it is "
        f"{_means(picked)}."
    )


def _means(decisive: Sequence[Record]) -> str:
    pairs = [(rank(mean(row["generated"])), rank(mean(row["human"]))) for row in decisive]
    above, equal = sum(own > human for own, human in pairs), sum(own == human for own, human in pairs)
    return f"above the human one's on {above}, equal on {equal}, below on {len(pairs) - above - equal}"


def data(measured: Mapping[str, Record]) -> list[list[str]]:
    """Every F held out of the table, in `COLUMNS`: one training a row."""
    return [line for env, row in ordered(measured) for line in _data(short_name(env), row)]


def _data(name: str, row: Record) -> Iterator[list[str]]:
    again = row.get("confirmed") or {"seeds": (), "generated": (), "human": ()}
    crowned, noise = row["crowned"], "yes" if again.get("noisy") else "no"
    drawn = range(row["seed"], sys.maxsize)
    raced = drawn[1:]  # the seed of the search chose among the generated rewards
    groups = [
        ("race", "no", "generated", crowned, raced, row["generated"]),
        *(("race", "no", "runner-up", place, raced, scores) for place, scores in row["runners_up"].items()),
        *(("race", "no", reward, "", drawn, row[reward]) for reward in ("human", "sparse")),
        ("other", noise, "generated", crowned, again["seeds"], again["generated"]),
        ("other", noise, "human", "", again["seeds"], again["human"]),
    ]
    for *kind, seeds, scores in groups:
        for seed, score in zip(seeds, scores, strict=False):
            yield [name, str(row["steps"]), *kind, str(seed), "" if score is None else repr(score)]


def measured_on(measured: Mapping[str, Record]) -> str:
    """When the rows were measured, and on what: trainings repeat to the bit only on the same kind of processor."""
    looks = [look for row in measured.values() for look in (row, row.get("confirmed")) if look is not None]
    dates = sorted(look["date"] for look in looks)
    kinds = Counter(map(_processor, looks))
    each = "".join(f"\n- {kind}: {count}" for kind, count in kinds.most_common())
    when = f"Measured from {dates[0]} to {dates[-1]}, on 2 cores."
    return f"{when} Rows by processor, other seeds a row of their own:\n{each}"


def _processor(look: Record) -> str:
    human = look.get("processor", "a processor that nobody wrote down")
    generated = look.get("generated_on", human)
    return human if generated == human else f"{generated} for the generated reward, {human} for the human one"


def left(measured: Mapping[str, Record]) -> str:
    """The missing tasks, a line each, with the time that they will take, estimated from their baselines."""
    whole, known, total, lines = load(PLAN), read(BASELINES), 0.0, list[str]()
    for env in (env for env in whole.tasks if env not in measured):
        trained = next(iter(known[env]["lanes"].values()))
        took = trained["training"]["minutes"] / (trained["training"]["lanes"] * trained["env_steps"])
        minutes = TRAININGS * whole.per_task[env]["steps"] * took
        total += minutes
        lines.append(f"{short_name(env):<32} {minutes / 60:5.1f} h")
    return "\n".join([*lines, f"{len(lines)} tasks, {total / 60:.0f} h"])


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", nargs="+", choices=load(PLAN).tasks, metavar="TASK", help="of the plan")
    parser.add_argument("--left", action="store_true")
    parser.add_argument("--again", choices=sorted(read(RESULTS)), nargs="+", help="rows that are known")
    parser.add_argument(
        "--confirm", type=fresh.several, default=0, metavar="SEEDS", help="more seeds for rows that are known"
    )
    options = parser.parse_args()
    whole = load(PLAN)
    if options.left:
        print(left(read(RESULTS)))
    elif options.again:
        for env in options.again:
            print(repeat(whole, env), flush=True)
    elif options.confirm:
        if unknown := [env for env in options.env or () if env not in read(RESULTS)]:
            parser.error(f"{unknown[0]} has no row yet: without --confirm it is measured.")
        for env in options.env or read(RESULTS):
            print(confirmed(env, options.confirm), flush=True)
        print(summary(read(RESULTS)))
    else:
        for env in options.env or whole.tasks:
            if env not in read(RESULTS):
                measure(whole, env)
        print(summary(read(RESULTS)))
