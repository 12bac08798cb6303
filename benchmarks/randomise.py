"""What worlds that differ cost: steps a second of a training with `randomise=wide` over those of one without.

    python benchmarks/randomise.py             # minutes on 2 quiet cores
    python benchmarks/randomise.py --tiny      # seconds, to see that it works

With and without take turns in pairs, the first of each pair alternating, so that a busy machine slows both alike; the
ratio is the median over pairs. Processor time is reported beside wall-clock time: it does not count what others do.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path

from guards import Pace, pace
from records import conditions, write

from openeureka.tasks.ranges import find
from openeureka.training.population import Population
from openeureka.types import LaneSpec, Ranges, TrainBudget

ENVS = ("cartpole", "ant", "anymal")


def population(drawn: Ranges | None) -> type[Population]:
    """Trains in worlds drawn from ranges."""

    class Randomised(Population):
        def __init__(self, env: str, specs: list[LaneSpec], budget: TrainBudget) -> None:
            steps = budget.env_steps
            super().__init__(env, specs, TrainBudget(env_steps=steps, randomise=drawn))

    return Randomised


def compare(env: str, pairs: int, epochs: int) -> dict[str, object]:
    ratios: list[Pace] = []
    kinds = {"on": population(find(env, "wide")), "off": population(None)}
    for name in kinds:
        pace(kinds[name], env, 1)  # the first of a process is slower, whatever it is
    for pair in range(pairs):
        order = ("on", "off") if pair % 2 else ("off", "on")
        paces = {name: pace(kinds[name], env, epochs) for name in order}
        ratios.append(Pace(*(a / b for a, b in zip(paces["on"], paces["off"], strict=True))))
        print(f"{env} {pair + 1}/{pairs}: wall {ratios[-1].wall:.3f}, processor {ratios[-1].processor:.3f}", flush=True)
    return {
        name: {"median": round(statistics.median(values), 4), "pairs": [round(value, 4) for value in values]}
        for name, values in zip(Pace._fields, zip(*ratios, strict=True), strict=True)
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--epochs", type=int, default=4)
    parser.add_argument("--tiny", action="store_true", help="one pair of one epoch, for a look")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "randomise.json")
    options = parser.parse_args()
    pairs, epochs = (1, 1) if options.tiny else (options.pairs, options.epochs)
    found = {"wide_over_none": {env: compare(env, pairs, epochs) for env in ENVS}, "epochs": epochs}
    write(options.out, {**found, **conditions("mujoco", "torch")})


if __name__ == "__main__":
    main()
