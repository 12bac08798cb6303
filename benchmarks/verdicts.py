"""How often does a race call equal rewards different? Scores are drawn at random; nothing trains.

    python benchmarks/verdicts.py      # minutes; writes benchmarks/results/verdicts.json
    make docs                          # the table in docs/reference/measurements.md

The races are those of `openeureka.method.race`. Their scores are drawn from normal distributions with the spreads of
the rows of docs/reference/headline.md, one row after another. Played and held-out scores are the same here, so a
winner is flattered as much as it can be. Three intervals decide in turn: the one in use; the one that it replaced,
which takes all rewards as equally noisy; and Welch's, which uses only the spreads of the two rewards compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from random import Random
from statistics import stdev, variance

import table
from records import Record, command_line, read, results, today, write

from openeureka import stats
from openeureka.method import race
from openeureka.stats import Difference, defined

RESULTS = results("verdicts")
RACES = 2500
"""For each row of the table, so many with equal rewards and so many with different ones."""
SEEDS = (3, 5)
GAP = 2.5
"""How much better the different rewards are, in spreads of the difference of one seed each."""
TITLES = (
    "interval", "`seeds`", "sure, though all are equal: mean over rows", "the worst row",
    f"sure, where the winner is better by {GAP} spreads", "seeds taken",
)  # fmt: skip

Spreads = tuple[Sequence[float], float]
"""Spreads of the rewards that race, and of the human one."""


def measure(races: int = RACES) -> Record:
    """Try all rules with each number of seeds."""
    rows = spreads(read(table.RESULTS))
    found: Record = {"races": races, "gap": GAP, "date": today(), "rows": rows, "rules": {}}
    for name, rule in RULES.items():
        for seeds in SEEDS:
            with deciding(rule):
                found["rules"][f"{name}/{seeds}"] = [_row(own, seeds, races) for own in rows.values()]
    return found


def spreads(measured: Mapping[str, Record]) -> dict[str, Spreads]:
    """Spreads by task, where F has more than two values: else no spread decides."""
    found: dict[str, Spreads] = {}
    for env, row in measured.items():
        generated, human, *others = map(defined, (row["generated"], row["human"], *row["runners_up"].values()))
        if not stats.two_valued([*generated, *human]):
            found[env] = [stdev(own) for own in (generated, *others) if len(own) > 1], stdev(human)
    return found


def _row(own: Spreads, seeds: int, races: int) -> Record:
    random = Random(0)
    rewards, human = own
    apart = GAP * math.hypot(rewards[0], human)
    equal = [held(random, own, seeds, 0.0) for _ in range(races)]
    better = [held(random, own, seeds, apart) for _ in range(races)]
    return {
        "sure": sum(found.sure for found, _ in equal) / races,
        "found": sum(found.sure and found.value > 0 for found, _ in better) / races,
        "seeds": sum(taken for _, taken in better) / races,
    }


def held(random: Random, own: Spreads, most: int, gap: float) -> tuple[Difference, int]:
    """One race: how the winner differs from the human reward, and the seeds it took."""
    drawn = {f"g0s{slot}": [random.gauss(gap, spread) for _ in range(most)] for slot, spread in enumerate(own[0])}
    human = [random.gauss(0.0, own[1]) for _ in range(most + 1)]
    scores: dict[str, Sequence[float]] = {}

    def look(names: Sequence[str], more: Sequence[int], so_far: Sequence[int]) -> tuple[race.Scores, Sequence[str]]:
        trained = len(so_far)
        scores.update({name: drawn[name][:trained] for name in names}, human=human[: trained + 1])
        return scores, [*drawn]

    winner = race.hold([*drawn], "human", range(most), look)[0]
    rivals = [scores[name] for name in drawn if name != winner]
    claims = len(drawn) / race.share(len(scores[winner]), most)
    found = race.difference(scores[winner], scores["human"], rivals, claims=claims)
    assert found is not None
    return found, len(scores[winner])


Rule = Callable[..., Difference | None]


@contextmanager
def deciding(rule: Rule) -> Iterator[None]:
    """Within the block, races are decided by another interval."""
    usual, race.difference = race.difference, rule
    try:
        yield
    finally:
        race.difference = usual


def pooled(
    own: Sequence[float], other: Sequence[float], rivals: Iterable[Sequence[float]] = (), *, claims: float = 1
) -> Difference:
    """All rewards are equally noisy, but for those without a spread."""
    noisy = [values for values in (own, other) if len({*values}) > 1] or [own, other]
    among = [*noisy, *(values for values in rivals if len({*values}) > 1)]
    spread, freedom = stats.pooled(among)
    return _interval(own, other, freedom, sum(spread**2 / len(values) for values in noisy), claims)


def welch(
    own: Sequence[float], other: Sequence[float], rivals: Iterable[Sequence[float]] = (), *, claims: float = 1
) -> Difference:
    """Each reward has a spread of its own (Welch 1947, with Satterthwaite's degrees of freedom)."""
    one, two = variance(own) / len(own), variance(other) / len(other)
    parts = one**2 / (len(own) - 1) + two**2 / (len(other) - 1)
    return _interval(own, other, (one + two) ** 2 / parts if parts else 1.0, one + two, claims)


def _interval(own: Sequence[float], other: Sequence[float], freedom: float, error: float, claims: float) -> Difference:
    value = math.fsum(own) / len(own) - math.fsum(other) / len(other)
    half = stats.quantile(freedom, claims) * math.sqrt(error)
    return Difference(value=value, low=value - half, high=value + half, seeds=None)


RULES: Mapping[str, Rule] = {
    "the one in use: the wider of two": race.difference,
    "one spread for all": pooled,
    "own spreads alone (Welch)": welch,
}


def rows(measured: Record) -> list[list[str]]:
    """One row per rule and number of seeds: means over the rows of the table."""
    found: list[list[str]] = []
    for name, per_row in measured.get("rules", {}).items():
        rule, seeds = name.split("/")
        sure, right, taken = ([row[what] for row in per_row] for what in ("sure", "found", "seeds"))
        shares = (stats.mean(sure), max(sure), stats.mean(right))
        found.append([rule, seeds, *(f"{100 * (share or 0):.1f} %" for share in shares), f"{stats.mean(taken):.2f}"])
    return found


def summary(measured: Record) -> str:
    """How often the interval in use errs with the fewest seeds, and how often it finds what there is."""
    _, seeds, equal, worst, better, _ = rows(measured)[0]
    return (
        f"With today's interval and {seeds} seeds, {equal} of races between equal rewards end in a false verdict, and "
        f"{worst} in the worst case. Where the winner is better by {measured['gap']} standard deviations, {better} of "
        f"races find it."
    )


if __name__ == "__main__":
    command_line(__doc__).parse_args()
    write(RESULTS, measure())
    for line in rows(read(RESULTS)):
        print("  ".join(line))
