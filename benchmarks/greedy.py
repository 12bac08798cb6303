"""Given the same rewards, which one does Eureka's own rule crown? docs/reference/headline.md has the answers.

    python benchmarks/greedy.py                       # every row of the table that has none yet
    python benchmarks/greedy.py --env anymal          # one
    python benchmarks/greedy.py --choices             # what both crown, without training

`search=eureka` crowns the reward with the highest F in training, of one training each. `search=best` lets policies
play, and races the leading rewards with fresh seeds. Both see the rewards and trainings of a row of `headline.py`.
Where they crown different ones, both train again with nine seeds that chose neither, and are judged alike: this
compares choices alone. Trainings are under `outputs/greedy/`; one that was killed goes on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import fresh
import headline
import table
from intervals import interval
from records import OUTPUTS, Record, command_line, keep, machine, read, results, write

from openeureka.benchmark.plan import load
from openeureka.config import short_name
from openeureka.numbers import spread
from openeureka.report.view import RunView
from openeureka.strategies import Ranking
from openeureka.types import History, Scored

RESULTS = results("greedy")
SEEDS = 9
TITLES = (
    "task", "`search=best` crowns", "`search=eureka` crowns",
    "F held out, `search=best`", "`search=eureka`", "difference, 95 % interval",
)  # fmt: skip


def greedy(history: History) -> Scored | None:
    """What a search crowns if it looks only at training."""
    unplayed = [
        replace(generation, entries=tuple(replace(entry, played=None) for entry in generation.entries))
        for generation in history.generations
    ]
    return Ranking(replace(history, generations=tuple(unplayed))).best


def choices(run: RunView) -> tuple[Scored, Scored]:
    """What both rules crown; one entry twice where that is the same reward."""
    own, other = run.history.entry(run.crown) or Ranking(run.history).best, greedy(run.history)
    assert own is not None and other is not None
    return own, own if other.sample.verdict.graph == own.sample.verdict.graph else other


def named(env: str) -> Record:
    """Both choices of a row by their places."""
    own, other = choices(headline.archived_run(env))
    return {"best": str(own.sample.place), "eureka": str(other.sample.place)}


def waits(row: Record) -> bool:
    """Whether the choices differ, and did not train again yet."""
    return row["best"] != row["eureka"] and "difference" not in row


def measure(env: str) -> Record:
    """What both choices of a row are worth, where they differ."""
    run = headline.archived_run(env)
    own, other = choices(run)
    known = read(table.RESULTS)[env].get("confirmed", {})
    reused = fresh.reusable(known, env, SEEDS)
    candidates = (entry.sample.candidate for entry in ((other,) if reused else (own, other)))
    sources = [candidate.source for candidate in candidates if candidate is not None]
    trained = fresh.trained(run.config, sources, OUTPUTS / "greedy" / env, SEEDS)
    first, second = (known["generated"], *trained.scores) if reused else trained.scores
    taken = ({"own_on": known["processor"]} if reused else {}) | ({"noisy": True} if trained.noisy else {})
    found = {"own": first, "other": second, "difference": fresh.between(second, first)}
    return {"seeds": trained.seeds, **found, **machine("cpu"), **taken}


def rows(measured: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task whose choices differ, in the order of the plan."""
    found = []
    for env in load(table.PLAN).tasks:
        row = measured.get(env, {})
        if "difference" in row:
            scores = spread(row["own"]), spread(row["other"]), interval(*row["difference"], digits=3)
            found.append((short_name(env), row["best"], row["eureka"], *scores))
    return found


def decisive() -> list[str]:
    """The rows that have something to compare: not both at zero."""
    return [env for env, row in read(table.RESULTS).items() if not table.scoreless(row)]


def summary(measured: Mapping[str, Record]) -> str:
    """All tasks in two sentences, and how many of them wait."""
    apart = [row["difference"] for row in measured.values() if "difference" in row]
    better, worse = sum(low > 0 for _, low, _ in apart), sum(high < 0 for _, _, high in apart)
    left = sum(map(waits, measured.values()))
    same = len(measured) - len(apart) - left
    return (
        f"On {same} of {len(decisive())} tasks both searches crown the same reward. Where they differ, the reward of "
        f"`search=best` is better on {better} tasks, worse on {worse} and level on {len(apart) - better - worse}. On "
        f"{left} tasks the seeds are not trained yet."
    )


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", nargs="+", choices=sorted(read(table.RESULTS)))
    parser.add_argument("--choices", action="store_true", help="only what both crown, which takes no training")
    options = parser.parse_args()
    tasks = options.env or decisive()
    known = read(RESULTS)
    write(RESULTS, known | {env: named(env) for env in tasks if env not in known})
    for env in [] if options.choices else tasks:
        if waits(read(RESULTS)[env]):
            row = read(RESULTS)[env] | measure(env)
            keep(RESULTS, env, row)
            print(env, row, flush=True)
    print(summary(read(RESULTS)))
