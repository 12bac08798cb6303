"""Tests what the paper claims about its parts: docs/reference/headline.md has the answers.

    python benchmarks/claims.py                        # what is missing; about four hours on 2 cores
    python benchmarks/claims.py --env ant --groups first reflection

A group is the eight replies to one prompt. Those of the first group are from the task's row in the table, the others
from `benchmarks/claims/TASK.json`, or from `benchmarks/longer/TASK.json` where a longer search asked for them. Groups
differ in the prompt or in the model: the first prompt of a search; the second with reward reflection, as our searches
send it; the same with the score alone; the first prompt of a search which began with the human reward; the first prompt
again, answered by the embedded model. The second prompts tell of the trainings of the task's row in the table. All
rewards train alike, with one seed that nothing was chosen by, and are judged in the same held-out episodes. Claims are
about groups, so the spread is that over rewards. A group is a run under `outputs/claims/`; one that was killed goes on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import hypot
from pathlib import Path
from statistics import fmean, variance

import fresh
import longer
import rungs
import table
from intervals import interval
from records import FOLDER, OUTPUTS, Record, command_line, keep, machine, read, results, show

import openeureka
from openeureka.benchmark.plan import load
from openeureka.numbers import number, spread
from openeureka.stats import defined, mean, pooled, quantile

REPLIES = FOLDER / "claims"
RESULTS = results("claims")
ROWS = load(table.PLAN).per_task
LONGER = tuple(env for env in load(longer.PLAN).tasks if not (REPLIES / f"{env}.json").exists())
"""Tasks whose second prompt a longer search sent: all that have such a search, except those that were asked before."""
STEPS = {env: ROWS[env]["steps"] for env in ("ant", "ballbalance", "quadcopter", *LONGER)}
"""Environment steps of each lane: those of the task's row."""
SEED = 300
"""The seed of all trainings: no search of these rewards used it."""
GROUPS = {
    "first": "first generation",
    "reflection": "second, with reflection",
    "scores": "second, with the score alone",
    "init": "first, from the human reward",
    "local": "first, the embedded model",
}
CLAIMS = {
    "Later generations are better": ("reflection", "first"),
    "Reflection helps": ("reflection", "scores"),
    "Beginning with the human reward helps": ("init", "first"),
    "A stronger model writes better rewards": ("first", "local"),
}
"""Claim -> the group that should score more, and the one it is compared with."""
TITLES = ("task", "rewards", "accepted", "F held out, mean", "the best of them", "human")
ANSWERS = ("claim", "task", "difference of means, 95 % interval", "holds here")


def accepted(env: str, replies: Sequence[str]) -> list[str]:
    """The rewards among these replies that the sandbox accepts, each once."""
    return list({candidate.id: candidate.source for candidate, _ in rungs.judged(env, replies)}.values())


def asked(env: str, group: str) -> list[str]:
    """The replies of a group; none where nobody asked for them."""
    row = read(Path(ROWS[env]["model"].removeprefix("replay:")))["replies"]
    if group == "first":
        return row
    if env in LONGER:
        return read(longer.ARCHIVE / f"{env}.json")["replies"][len(row) : 2 * len(row)] if group == "reflection" else []
    return read(REPLIES / f"{env}.json")["replies"][group]


def left(measured: Mapping[str, Record]) -> Iterator[tuple[str, str]]:
    """The tasks and groups that have replies and are not measured."""
    for env in STEPS:
        yield from ((env, group) for group in GROUPS if group not in measured.get(env, {}) and asked(env, group))


def measure(env: str, group: str) -> Record:
    """Held-out F of a group's rewards; with the first group, of the human one too."""
    replies = asked(env, group)
    rewards = accepted(env, replies)
    others = ["human"] if group == "first" else []
    run = openeureka.train(
        env, [*rewards, *others], dir=OUTPUTS / "claims" / f"{env}_{group}", seed=SEED, steps=STEPS[env]
    )
    scores = [mean(own.scores) for own in run.view.given.values()]
    own = {"replies": len(replies), "scores": scores[: len(rewards)]}
    return {**own, **({"human": scores[-1]} if others else {}), "steps": STEPS[env], "seed": SEED, **machine("cpu")}


def rows(measured: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task and group."""
    found = []
    for env, groups in measured.items():
        for group, title in GROUPS.items():
            if group in groups:
                row = groups[group]
                share, scores = f"{len(row['scores'])} of {row['replies']}", defined(row["scores"])
                best, human = number(max(scores, default=None)), number(row.get("human"))
                found.append((env, title, share, spread(scores), best, human))
    return found


def compared(measured: Mapping[str, Record], better: str, worse: str) -> dict[str, tuple[list[float], list[float]]]:
    """Scores of two groups by task, where both have several and some differ: else nothing says how far chance goes."""
    found = {
        env: (defined(own[better]["scores"]), defined(own[worse]["scores"]))
        for env, own in measured.items()
        if better in own and worse in own
    }
    return {env: both for env, both in found.items() if min(map(len, both)) > 1 and any(map(variance, both))}


def together(groups: Iterable[tuple[list[float], list[float]]]) -> list[float]:
    """Mean over tasks of the difference in standard deviations of rewards, and the ends of its interval, which holds
    together with those of the other claims."""
    shifts, errors, freedoms = [], [], []
    for own, other in groups:
        spread, freedom = pooled((own, other))
        shifts.append((fmean(own) - fmean(other)) / spread)
        errors.append((1 / len(own) + 1 / len(other)) ** 0.5)
        freedoms.append(freedom)
    middle, half = fmean(shifts), quantile(sum(freedoms), len(CLAIMS)) * hypot(*errors) / len(shifts)
    return [middle, middle - half, middle + half]


def answers(measured: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per claim and task, and one per claim over all its tasks. The intervals of one task hold together, and so
    do those over all tasks."""
    found = []
    for claim, (better, worse) in CLAIMS.items():
        groups = compared(measured, better, worse)
        apart = {env: fresh.between(other, own, claims=len(CLAIMS)) for env, (own, other) in groups.items()}
        apart |= {"all, in standard deviations": together(groups.values())} if len(groups) > 1 else {}
        for env, (value, low, high) in apart.items():
            holds = "yes" if low > 0 else "no, the reverse" if high < 0 else "not decided"
            found.append((claim, env, interval(value, low, high, digits=3), holds))
    return found


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--env", nargs="+", choices=STEPS, default=list(STEPS))
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS))
    options = parser.parse_args()
    for env, group in left(read(RESULTS)):
        if env in options.env and group in options.groups:
            row = measure(env, group)
            keep(RESULTS, env, read(RESULTS).get(env, {}) | {group: row})
            print(env, group, row["scores"], flush=True)
    show(*answers(read(RESULTS)))
