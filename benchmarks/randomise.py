"""What randomised worlds cost: steps a second of a training with `randomise=wide` over those of one without. A table
of docs/guides/robot.md.

    python benchmarks/randomise.py             # minutes on 2 quiet cores
    python benchmarks/randomise.py --tiny      # seconds, to see that it works; kept nowhere

Both alternate, in pairs that begin with the one or the other in turn, so that a busy machine slows both alike; the
ratio is the median over pairs. Processor time is reported besides wall-clock time: it does not count what other
processes do.
"""

from __future__ import annotations

from pathlib import Path

from guards import compare
from records import Record, command_line, conditions, results, write

from openeureka.tasks.ranges import find
from openeureka.training.population import Population
from openeureka.types import LaneSpec, Ranges, TrainBudget

ENVS = ("cartpole", "ant", "anymal")
PAIRS, EPOCHS = 5, 4
RESULTS = results("randomise")
TITLES = ("task", "steps a second, of those without", "lowest and highest pair", "by processor time")


def population(drawn: Ranges | None) -> type[Population]:
    """A kind of population that trains in worlds drawn from ranges."""

    class Randomised(Population):
        def __init__(self, env: str, specs: list[LaneSpec], budget: TrainBudget) -> None:
            steps = budget.env_steps
            super().__init__(env, specs, TrainBudget(env_steps=steps, randomise=drawn))

    return Randomised


def rows(measured: Record) -> list[list[str]]:
    """One row per task."""
    return [_row(env, found) for env, found in measured.get("wide_over_none", {}).items()]


def _row(env: str, found: Record) -> list[str]:
    pairs, (wall, processor) = found["wall"]["pairs"], (found[kind]["median"] for kind in ("wall", "processor"))
    return [env, f"{wall:.2f}", f"{min(pairs):.2f} to {max(pairs):.2f}", f"{processor:.2f}"]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--tiny", action="store_true", help="one pair of one epoch, kept nowhere")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    pairs, epochs = (1, 1) if options.tiny else (PAIRS, EPOCHS)
    found = {env: compare(env, population(find(env, "wide")), population(None), pairs, epochs) for env in ENVS}
    if not options.tiny:
        write(options.out, {"wide_over_none": found, "epochs": epochs, **conditions("mujoco", "torch")})


if __name__ == "__main__":
    main()
