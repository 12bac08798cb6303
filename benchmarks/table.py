"""What docs/reference/headline.md says: how each row of `headline.py` ends, the table, its figures and its data."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from intervals import interval
from records import FOLDER, ROOT, Record, results

from openeureka.benchmark.plan import load
from openeureka.config import short_name
from openeureka.numbers import number, spread
from openeureka.score import clipped, learnt, plainly_normalised, rank
from openeureka.stats import defined, difference, mean, two_valued

PLAN = FOLDER / "plans" / "headline.yaml"
ARCHIVE = FOLDER / "headline"
REWARDS = ARCHIVE / "rewards"
RESULTS = results("headline")

TITLES = (
    "task", "steps", "generated, F held out", "human", "sparse", "untrained",
    "generated minus human, 95 % interval", "the generated one is", "score", "clipped", "correlation",
)  # fmt: skip
ENDINGS = {
    "better": "better than the human one",
    "level": "level with it: no difference shown",
    "worse": "worse",
    "too few seeds": "not decided: three seeds are too few to tell",
    "nothing learnt": "not decided: neither is shown to do better than no training",
    "one seed": "not decided: one seed",
}
COLUMNS = "task", "steps", "seeds", "noise", "reward", "candidate", "seed", "f_held_out"


def reward_file(env: str) -> Path:
    """The file of a task's winner."""
    return REWARDS / f"{short_name(env)}.py"


def decided(row: Record) -> Record:
    """The row with the scores that decide it: those of seeds that chose nothing, where there are any."""
    return row | row["confirmed"] | {"runners_up": {}} if row.get("confirmed") else row


def confirmations(row: Record) -> list[Record]:
    """What seeds that chose nothing say of the row: shorter trainings first, those that decide it last."""
    return [*row.get("shorter", ()), row["confirmed"]] if row.get("confirmed") else []


def noisy(row: Record) -> bool:
    """Whether the policies that decide the row play with noise."""
    return bool(decided(row).get("noisy"))


def beginners(row: Record) -> list[float | None]:
    """F held out by seed of policies that never trained; empty where they did not play as those that decide the row."""
    found, own = row.get("untrained"), decided(row)
    alike = found and (found["noisy"], found["seeds"][0]) == (noisy(row), own.get("seeds", [row.get("seed")])[0])
    return found["scores"] if alike else []


def scoreless(row: Record) -> bool:
    """Whether both rewards score zero."""
    return not any(defined([*decided(row)["generated"], *decided(row)["human"]]))


def ending(row: Record) -> str:
    """How a row ends. A tie of policies that are not shown to beat untrained ones is undecided: it says nothing of
    either reward.
    """
    untrained, row = beginners(row), decided(row)
    rewards = row["generated"], row["human"]
    if scoreless(row):
        return "nothing learnt"
    if row["difference"] is None:
        return "one seed"
    _, low, high = row["difference"]
    if low > 0 or high < 0:
        return "better" if low > 0 else "worse"
    if not learnt(rewards, untrained):
        return "nothing learnt"
    return "level" if decidable(row) else "too few seeds"


def decidable(row: Record) -> bool:
    """Whether so few seeds can decide. Where F has two values they may not: even all against none can be chance."""
    own, human, *among = map(defined, (row["generated"], row["human"], *row.get("runners_up", {}).values()))
    if not two_valued([*own, *human]):
        return True
    low, high = min(*own, *human), max(*own, *human)
    if low == high:
        low, high = 0.0, 1.0
    split = difference([high] * len(own), [low] * len(human), among, claims=1 + len(among))
    return split is not None and split.low > 0


def ordered(measured: Mapping[str, Record]) -> Iterator[tuple[str, Record]]:
    """Tasks and rows, in the order of the plan."""
    return ((env, measured[env]) for env in load(PLAN).tasks if env in measured)


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """One row per task, in the order of the plan. Where its reward trained again, rows below have the seeds that
    chose nothing.
    """
    found: list[list[str]] = []
    for env, row in ordered(measured):
        name, untrained, others = short_name(env), beginners(row), confirmations(row)
        first = (
            f"[{name}](../../{reward_file(env).relative_to(ROOT)})",
            f"{row['steps']:,}",
            *_scores({**row, "confirmed": None}, row["sparse"], [] if others else untrained),
        )
        found.append([*first, number(row["correlation_with_human"], 2)])
        for again in others:
            how = " that play with noise" if again.get("noisy") else ""
            title = f"{name}, {len(again['seeds'])} other seeds{how}"
            alike = "steps" not in again and not again.get("noisy")  # the sparse reward trained and played as they did
            own = {**again, "untrained": row.get("untrained")}
            scores = _scores(own, row["sparse"] if alike else [], untrained)
            found.append([title, f"{again['steps']:,}" if "steps" in again else "", *scores, ""])
    return found


def _scores(row: Record, sparse: Sequence[float | None], untrained: Sequence[float | None]) -> tuple[str, ...]:
    between = interval(*row["difference"], digits=3) if row["difference"] is not None else "-"
    scores = row["generated"], row["human"], sparse
    score = plainly_normalised(*map(mean, scores))
    return *map(spread, (*scores, untrained)), between, ending(row), number(score, 3), number(clipped(score), 3)


def differences(measured: Mapping[str, Record]) -> Iterator[tuple[str, Record]]:
    """The decisive scores of the rows that have a difference, in the order of the plan."""
    known = ((short_name(env), decided(row)) for env, row in ordered(measured))
    return ((name, row) for name, row in known if row["difference"] is not None)


def gains(measured: Mapping[str, Record]) -> list[tuple[str, str, float, float, float]]:
    """One row per task on which something was learnt: how it ended, and the difference and its interval, as shares of
    the larger F."""
    found = []
    for name, row in differences(measured):
        if ending(row) != "nothing learnt":
            largest = max(abs(mean(row[name]) or 0.0) for name in ("generated", "human"))
            value, low, high = (end / largest for end in row["difference"])
            found.append((name, ending(row), value, low, high))
    return found


def novelty(measured: Mapping[str, Record]) -> list[tuple[str, str, float, float]]:
    """One row per task on which something was learnt: how it ended, correlation with the human reward, and the
    difference in units of half its interval: beyond 1 it is decided. Differences without a spread are left out."""
    found = []
    for name, row in differences(measured):
        (value, _, high), how = row["difference"], ending(row)
        if how != "nothing learnt" and (high > value or not value):
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
    few = f" On {ends['too few seeds']}, three seeds are too few to tell." if ends["too few seeds"] else ""
    unknown = f" On {ends['one seed']} it is not known, as one seed trained." if ends["one seed"] else ""
    decisive = [row for row in measured.values() if ending(row) != "nothing learnt"]
    other = [decided(row) for row in decisive if row.get("confirmed")]
    picked = [row for row in decisive if not row.get("confirmed")]
    return (
        f"{len(measured)} of {len(load(PLAN).tasks)} tasks are measured. The generated reward is better than the human "
        f"one on {ends['better']} of them, level on {ends['level']}, worse on {ends['worse']}."
        f"{few} On {ends['nothing learnt']}, neither reward is shown to do better than no training.{unknown}\n"
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
    crowned, steps, drawn, untrained = row["crowned"], row["steps"], range(row["seed"], sys.maxsize), beginners(row)
    raced = drawn[1:]  # the seed of the search chose among the generated rewards

    def lines(
        steps: int,
        kind: str,
        noise: bool,
        reward: str,
        place: str,
        seeds: Sequence[int],
        scores: Sequence[float | None],
    ) -> Iterator[list[str]]:
        for seed, score in zip(seeds, scores, strict=False):
            told = "" if score is None else repr(score)
            yield [name, str(steps), kind, "yes" if noise else "no", reward, place, str(seed), told]

    yield from lines(steps, "race", False, "generated", crowned, raced, row["generated"])
    for place, scores in row["runners_up"].items():
        yield from lines(steps, "race", False, "runner-up", place, raced, scores)
    for reward in ("human", "sparse"):
        yield from lines(steps, "race", False, reward, "", drawn, row[reward])
    for again in confirmations(row):
        trained, noise = again.get("steps", steps), bool(again.get("noisy"))
        yield from lines(trained, "other", noise, "generated", crowned, again["seeds"], again["generated"])
        yield from lines(trained, "other", noise, "human", "", again["seeds"], again["human"])
    if untrained:
        yield from lines(0, "none", noisy(row), "untrained", "", row["untrained"]["seeds"], untrained)


def measured_on(measured: Mapping[str, Record]) -> str:
    """When the rows were measured, and on what: trainings repeat to the bit only on the same kind of processor."""
    every = [each for row in measured.values() for each in (row, *confirmations(row))]
    dates = sorted(each["date"] for each in every)
    kinds = Counter(map(_processor, every))
    each = "".join(f"\n- {kind}: {count}" for kind, count in kinds.most_common())
    when = f"Measured from {dates[0]} to {dates[-1]}, on 2 cores."
    return f"{when} Rows by processor, other seeds a row of their own:\n{each}"


def _processor(row: Record) -> str:
    human = row.get("processor", "a processor that nobody wrote down")
    generated = row.get("generated_on", human)
    return human if generated == human else f"{generated} for the generated reward, {human} for the human one"
