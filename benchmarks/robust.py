"""What ranges are worth: F of a policy trained in one world (plain), in worlds that nobody gave a reason for (uniform)
and in those of `eureka robust` (ours), in its own world and in hard ones. A table of docs/guides/robot.md.

    python benchmarks/robust.py model=gpt-5                     # all that is missing, hours; model=random is the floor
    python benchmarks/robust.py model=gpt-5 --env ant --seed 1  # one of nine
    python benchmarks/robust.py --tiny                          # minutes, to see that it works

The reward is the task's human one, so that only the worlds differ. Every training takes the task's own number of steps.
A seed is kept in benchmarks/results/robust.json once it is known. Runs are under outputs/robust/, and the same command
goes on where it was.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ledger import OUTPUTS
from records import Record, machine, read, write

import openeureka
from openeureka.cli.tune import robust
from openeureka.hardened import PLAIN, UNIFORM, Carried, RobustArm
from openeureka.report.text import spread
from openeureka.report.view import RunView
from openeureka.score import mean

ENVS = ("anymal", "ant", "quadcopter")
SEEDS = 3
ARMS = (PLAIN, UNIFORM, "ours")
RESULTS = Path(__file__).parent / "results" / "robust.json"
TITLES = (
    *("task", "seeds", "plain: own world", "hard ones", "uniform: own world", "hard ones", "ours: own world"),
    *("hard ones", "ours gives up in its own world", "ours loses in hard ones, as a share of what plain loses"),
    "uniform loses",
)


def measure(env: str, seed: int, directory: Path, words: Sequence[str], **settings: Any) -> Record:
    """One training in one world, the search for ranges, and how the three policies do."""
    run = openeureka.train(env, "human", seed=seed, seeds=1, dir=directory, **settings)
    robust([str(run.directory), *words])
    view = RunView.read(directory)
    found = view.robust
    assert found is not None
    arms = {"ours" if arm.name == found.ours else arm.name: arm for arm in found.arms}
    return {
        "settings": [*words],
        "steps": run.config.steps,
        **machine("cpu"),
        "ranges": {arm.name: str(arm.ranges) for arm in found.arms if arm.ranges is not None},
        "ours": found.ours,
        "arms": {name: _arm(arms[name]) for name in ARMS},
        "before": _swept(found.before),
        "after": _swept(found.after),
    }


def _arm(arm: RobustArm) -> Record:
    return {
        "nominal": arm.nominal.fitness if arm.nominal is not None else None,
        "hard": arm.hard,
        "worlds": {name: score.fitness for name, score in arm.worlds.items()},
    }


def _swept(found: Sequence[Carried]) -> dict[str, list[tuple[float, float | None]]]:
    return {one.name: [(value, fitness) for value, fitness, _ in one.points] for one in found}


def rows(measured: Mapping[str, Mapping[str, Record]]) -> list[list[str]]:
    """A row a task, over the seeds that are known."""
    return [_row(env, [*measured[env].values()]) for env in ENVS if measured.get(env)]


def _row(env: str, seeds: Sequence[Record]) -> list[str]:
    of = {(arm, kind): [seed["arms"][arm][kind] for seed in seeds] for arm in ARMS for kind in ("nominal", "hard")}
    means = {key: mean(values) for key, values in of.items()}
    (nominal, share), (_, uniform) = losses(means, "ours"), losses(means, UNIFORM)
    return [env, str(len(seeds)), *map(spread, of.values()), *map(_percent, (nominal, share, uniform))]


def losses(means: Mapping[tuple[str, str], float | None], arm: str) -> tuple[float | None, float | None]:
    """What an arm loses: in its own world as a share of plain's F, in hard ones as a share of what plain loses."""
    plain, hard, own, own_hard = (means[which, kind] for which in (PLAIN, arm) for kind in ("nominal", "hard"))
    if plain is None or hard is None or own is None or own_hard is None:
        return None, None
    nominal = (plain - own) / abs(plain) if plain else None
    return nominal, (own - own_hard) / (plain - hard) if plain > hard else None


def _percent(share: float | None) -> str:
    return f"{share:.0%}" if share is not None else "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", default=["model=random"], help="settings of eureka robust")
    parser.add_argument("--env", action="append", choices=ENVS, help="a task; may be repeated")
    parser.add_argument("--seed", action="append", type=int, help="may be repeated; 0, 1 and 2 by default")
    parser.add_argument("--tiny", action="store_true", help="short episodes and trainings of one task, kept nowhere")
    options = parser.parse_args()
    if options.tiny:
        tiny = "quadcopter+episode_length=20"
        found = measure(tiny, 0, OUTPUTS / "robust" / "tiny", [*options.words, "sample=2"], steps=2048, worlds=32)
        print(*_row(tiny, [found]), sep=" | ")
        return
    for env in options.env or ENVS:
        for seed in options.seed or range(SEEDS):
            known = read(RESULTS)
            if str(seed) in known.get(env, {}):
                continue
            found = measure(env, seed, OUTPUTS / "robust" / f"{env}_{seed}", options.words)
            seeds = {**known.get(env, {}), str(seed): found}
            write(RESULTS, {**known, env: seeds})
            print(*_row(env, [*seeds.values()]), sep=" | ", flush=True)


if __name__ == "__main__":
    main()
