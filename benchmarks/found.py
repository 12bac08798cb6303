"""Two generated rewards compared with the human one, with seeds that chose neither: the table of README.md.

    python benchmarks/found.py               # BallBalance, five fresh seeds of each; 15 lanes of 600,000 steps

The replies are in `benchmarks/found/`, unchanged. `strong.md`: of eight in `benchmarks/choosing/ballbalance.json`,
the one whose policy plays best with the seed that a search would use. `embedded.md`: the winner of a `make run`.
"""

from __future__ import annotations

from fresh import held_out
from records import FOLDER, OUTPUTS, Record, command_line, machine, read, results, show, write

import openeureka
from openeureka.numbers import number
from openeureka.stats import difference, mean

REPLIES = FOLDER / "found"
RESULTS = results("found")
AUTHORS = {
    "strong": "a strong model (Claude): the best of its eight first replies",
    "embedded": "the embedded model: the reward above",
    "human": "people, in Isaac Gym",
}
SEEDS = 5
SETTINGS = {"steps": 600_000, "seed": 100, "seeds": SEEDS}
TITLES = ("the reward is by", "F held out", "each seed", "more than the human one, 95 % interval")


def measure() -> Record:
    """Train all lanes at once and read what came of them."""
    rewards = ["human" if name == "human" else REPLIES / f"{name}.md" for name in AUTHORS]
    run = openeureka.train("ballbalance", rewards, dir=OUTPUTS / "found", **SETTINGS)
    return {"settings": SETTINGS, **machine("cpu"), "held_out": held_out(run, SEEDS)}


def rows(measured: Record) -> list[tuple[str, ...]]:
    """A row for each reward, best first: held-out F over seeds, and the interval of its difference to the human one."""
    rewards: dict[str, list[float]] = measured["held_out"]
    return [_row(name, rewards) for name in sorted(rewards, key=lambda name: -(mean(rewards[name]) or 0.0))]


def _row(name: str, rewards: dict[str, list[float]]) -> tuple[str, ...]:
    rivals = [rewards[other] for other in rewards if other not in (name, "human")]
    found = difference(rewards[name], rewards["human"], rivals, claims=len(rewards) - 1)
    between = f"{found.value:+.0f} ({found.low:+.0f} to {found.high:+.0f})" if found and name != "human" else ""
    seeds = ", ".join(number(value, 3) for value in rewards[name])
    return AUTHORS[name], f"**{number(mean(rewards[name]), 3)}**", seeds, between


if __name__ == "__main__":
    command_line(__doc__).parse_args()
    write(RESULTS, measure())
    show(TITLES, *rows(read(RESULTS)))
