"""What `observe=measurable` costs in F: the human reward, policies that see all against those that see what a robot's
sensors tell, held out, seed by seed.

    python benchmarks/measurable.py              # hours on 2 cores
    python benchmarks/measurable.py --tiny       # minutes, to see that it works

Runs are kept in outputs/measurable_bench, and the same command goes on where it was.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from records import conditions, write

import openeureka
from openeureka.score import difference, mean

ENVS = ("anymal", "ant", "humanoid")


def scores(env: str, observe: str, seeds: int, out: Path, **settings: object) -> list[float]:
    """Held-out F by seed."""
    directory = out / f"{env.partition('+')[0]}_{observe}"
    run = openeureka.train(env, "human", observe=observe, seeds=seeds, dir=directory, **settings)  # type: ignore[arg-type]
    return list(run.view.given["human"].scores)


def compare(env: str, seeds: int, out: Path, **settings: object) -> dict[str, object]:
    everything, measurable = (scores(env, observe, seeds, out, **settings) for observe in ("all", "measurable"))
    found = difference(measurable, everything, [measurable, everything])
    interval = [found.low, found.high] if found is not None else None
    return {
        "all": everything,
        "measurable": measurable,
        "means": [mean(everything), mean(measurable)],
        "difference_95": interval,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--tiny", action="store_true", help="short episodes and trainings of one task, for a look")
    parser.add_argument("--runs", type=Path, default=Path("outputs/measurable_bench"))
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "measurable.json")
    options = parser.parse_args()
    envs, seeds, small = ENVS, options.seeds, {}
    if options.tiny:
        envs, seeds, small = ("ant+episode_length=20",), 1, {"steps": 2048, "worlds": 32}
    found = {env: compare(env, seeds, options.runs, **small) for env in envs}
    for env, own in found.items():
        print(env, own)
    write(options.out, {"tasks": found, **conditions("mujoco", "torch")})


if __name__ == "__main__":
    main()
