"""Two generated rewards beside the human one, with seeds that neither was chosen by: the table of README.md.

    python benchmarks/found.py               # BallBalance, five fresh seeds of each; 15 lanes of 600,000 steps
    python benchmarks/found.py --markdown    # the table

The replies are in `benchmarks/found/`, as they came. `strong.md`: of eight in `benchmarks/choosing/ballbalance.json`,
the one whose policy plays best with the seed that a search would use. `embedded.md`: the winner of a `make run`.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from records import FOLDER, OUTPUTS, command_line, machine, read, results, write

from openeureka.numbers import number
from openeureka.stats import difference, mean

REPLIES = FOLDER / "found"
RESULTS = results("found")
AUTHORS = {
    "strong": "a strong model (Claude): the best of its eight first replies",
    "embedded": "the embedded model: the reward above",
    "human": "people, in Isaac Gym",
}
SETTINGS = ("env=ballbalance", "steps=600000", "seed=100", "seeds=5")


def measure() -> dict[str, Any]:
    """Train all lanes at once and read what came of them."""
    rewards = ",".join("human" if name == "human" else str(REPLIES / f"{name}.md") for name in AUTHORS)
    command = [
        Path(sys.executable).with_name("eureka"),
        "train",
        *SETTINGS,
        f"reward={rewards}",
        f"dir={OUTPUTS / 'found'}",
        "--json",
    ]
    lanes = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)["given"].values()
    return {
        "settings": " ".join(SETTINGS),
        **machine("cpu"),
        "held_out": {name: _seeds(lanes, name) for name in AUTHORS},
    }


def _seeds(lanes: Iterable[dict[str, Any]], name: str) -> list[float]:
    """Held-out F of each seed, in their order."""
    return [lane["held_out_fitness"] for lane in sorted(lanes, key=lambda lane: lane["seed"]) if lane["reward"] == name]


def markdown() -> str:
    """A row for each reward, best first: held-out F over seeds, and the interval of its difference to the human one."""
    held_out: dict[str, list[float]] = read(RESULTS)["held_out"]
    lines = [
        "| the reward is by | F held out | each seed | more than the human one, 95 % interval |",
        "| --- " * 4 + "|",
    ]
    for name in sorted(held_out, key=lambda name: -(mean(held_out[name]) or 0.0)):
        rivals = [held_out[other] for other in held_out if other not in (name, "human")]
        found = difference(held_out[name], held_out["human"], rivals, claims=len(held_out) - 1)
        between = f"{found.value:+.0f} ({found.low:+.0f} to {found.high:+.0f})" if found and name != "human" else ""
        seeds = ", ".join(number(value, 3) for value in held_out[name])
        lines.append(f"| {AUTHORS[name]} | **{number(mean(held_out[name]), 3)}** | {seeds} | {between} |")
    return "\n".join(lines)


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--markdown", action="store_true")
    if not parser.parse_args().markdown:
        write(RESULTS, measure())
    print(markdown())
