"""What ranges are worth: F of a policy trained in one world (plain), in worlds that nobody gave a reason for (uniform)
and in those of `eureka robust` (ours), in its own world and in hard ones.

    python benchmarks/robust.py model=gpt-5              # hours; model=random is the floor
    python benchmarks/robust.py --tiny                   # minutes, to see that it works

The reward is the task's human one, so that only the worlds differ. Every training takes the task's own number of steps.
Runs are kept in outputs/robust_bench, and the same command goes on where it was.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from records import conditions, write

import openeureka
from openeureka.cli.tune import robust
from openeureka.hardened import PLAIN, UNIFORM, Robust
from openeureka.report.view import RunView
from openeureka.score import mean

ENVS = ("anymal", "ant", "quadcopter")
SEEDS = 3


def scores(found: Robust) -> dict[str, dict[str, float | None]]:
    """F in a policy's own world and over hard ones, by name."""
    arms = {"ours" if arm.name == found.ours else arm.name: arm for arm in found.arms}
    return {
        name: {"nominal": arms[name].nominal.fitness if arms[name].nominal else None, "hard": arms[name].hard}
        for name in (PLAIN, UNIFORM, "ours")
    }


def compare(env: str, seed: int, out: Path, words: list[str], **settings: object) -> dict[str, dict[str, float | None]]:
    """One training of each, and the search for ranges between."""
    directory = out / f"{env.partition('+')[0]}_{seed}"
    run = openeureka.train(env, "human", seed=seed, seeds=1, dir=directory, **settings)  # type: ignore[arg-type]
    robust([str(run.directory), *words])
    found = RunView.read(directory).robust
    assert found is not None
    return scores(found)


def summary(seeds: list[dict[str, dict[str, float | None]]]) -> dict[str, dict[str, float | None]]:
    """Means over seeds; what each loses in its own world against plain, and how much of plain's loss in hard ones."""
    means = {
        name: {kind: mean([seed[name][kind] for seed in seeds]) for kind in ("nominal", "hard")} for name in seeds[0]
    }
    plain = means[PLAIN]
    for own in means.values():
        if None in (*own.values(), *plain.values()):
            continue
        drop = plain["nominal"] - plain["hard"]  # type: ignore[operator]
        own["lost_nominally"] = (plain["nominal"] - own["nominal"]) / abs(plain["nominal"])  # type: ignore[operator, arg-type]
        own["share_of_plain_s_loss"] = (own["nominal"] - own["hard"]) / drop if drop else None  # type: ignore[operator]
    return means


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", default=["model=random"], help="settings of eureka robust")
    parser.add_argument("--tiny", action="store_true", help="short episodes and trainings of one task, for a look")
    parser.add_argument("--runs", type=Path, default=Path("outputs/robust_bench"))
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "robust.json")
    options = parser.parse_args()
    envs, seeds, small = ENVS, SEEDS, {}
    words = [*options.words]
    if options.tiny:
        envs, seeds, small = ("quadcopter+episode_length=20",), 1, {"steps": 2048, "worlds": 32}
        words.append("sample=2")
    found = {env: [compare(env, seed, options.runs, words, **small) for seed in range(seeds)] for env in envs}
    means = {env: summary(own) for env, own in found.items()}
    for env, own in means.items():
        print(env, own)
    write(options.out, {"settings": words, "seeds": found, "means": means, **conditions("mujoco", "torch")})


if __name__ == "__main__":
    main()
