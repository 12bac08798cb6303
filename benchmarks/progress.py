"""What `bonus=progress` is worth where F stays 0: the same rewards with and without pay for rare progress.

    python benchmarks/progress.py                              # four tasks; about a night on 2 cores
    python benchmarks/progress.py --env shadow_hand_over       # one
    python benchmarks/progress.py --tiny --dir D --out F.json  # seconds a task, to see that it works
    python benchmarks/progress.py --left                       # what is missing, and what is known as a table

The two rewards of a task (`benchmarks/progress/TASK/*.py`) were written from `eureka context env=TASK` alone, and tell
progress. Both arms train the same files with the same seeds and as many steps; only `bonus=` differs. An arm of a task
is a run such as `eureka train` makes, under `outputs/progress/`: one that was killed goes on with the same command.
`benchmarks/results/progress.json` is written after each arm, and what it holds is not repeated.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from lanes import PEAKS, by_reward, record
from ledger import learn
from records import FOLDER, OUTPUTS, Record, amount, command_line, keep, machine, read, results, show

from openeureka.config import TrainConfig
from openeureka.numbers import number, spread
from openeureka.score import rank
from openeureka.stats import mean
from openeureka.tasks.registry import get
from openeureka.types import PROGRESS, TrainingResult

REWARDS = FOLDER / "progress"
RESULTS = results("progress")
STEPS = 1_000_000
"""Environment steps of each lane, as in `benchmarks/plans/headline.yaml`."""
SEEDS = 3
ARMS = ("none", "progress")
TITLES = ("task", "steps", "reward", "F held out, none", "with progress", "furthest progress, none", "with progress")


def tasks() -> list[str]:
    return sorted(folder.name for folder in REWARDS.iterdir() if folder.is_dir())


def rewards(env: str) -> list[Path]:
    return sorted((REWARDS / env).glob("*.py"))


def measure(env: str, arm: str, entry: Record, options: argparse.Namespace) -> Record:
    """One arm of a task: a record of each lane."""
    config = TrainConfig(
        env=f"{env}+episode_length=8" if options.tiny else env,
        reward=",".join(map(str, rewards(env))),
        bonus=arm,
        seeds=entry["seeds"],
        steps=entry["steps"],
        worlds=entry["worlds"],
        dir=str(options.dir / f"{env}_{arm}"),
    )
    lanes = {
        lane: {**record(result, held_out), "progress": furthest(result)}
        for lane, (result, held_out) in learn(config, PEAKS).items()
    }
    return {"lanes": lanes, **machine("cpu")}


def furthest(result: TrainingResult) -> Record:
    """The highest mean over an epoch of each progress value; more than 1 counts as 1."""
    curves = {name.removeprefix("component/"): curve for name, curve in result.curves.items()}
    told = {name: curve for name, curve in curves.items() if name.startswith(PROGRESS)}
    known = {name: [value for value in curve if value is not None] for name, curve in told.items()}
    return {name: round(min(1.0, max(values)), 4) for name, values in known.items() if values}


# --- what it says ----------------------------------------------------------------------------------------------------


def rows(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task and reward whose arms are both known."""
    found: list[tuple[str, ...]] = []
    for env, entry in study.items():
        if lacks(entry):
            continue
        for path in rewards(env):
            arms = [[*by_reward(entry["arms"][arm]["lanes"]).get(path.stem, {}).values()] for arm in ARMS]
            scores = [spread([played(lane) for lane in lanes]) for lanes in arms]
            found.append((env, f"{entry['steps']:,}", path.stem, *scores, *map(_reached, arms)))
    return found


def played(lane: Record) -> float | None:
    """Held-out F of the better of its policies."""
    return max((lane[f"held_out_at_peak_of_{peak}"]["fitness"] for peak in PEAKS), key=rank)


def lacks(entry: Record | None) -> bool:
    """Whether an arm of a task is missing: a task that was interrupted between them has only the first."""
    return entry is None or not set(ARMS) <= entry["arms"].keys()


def _reached(lanes: Sequence[Record]) -> str:
    """Mean over seeds of each progress value's highest epoch."""
    names = {name: None for lane in lanes for name in lane["progress"]}
    means = {name: mean([lane["progress"].get(name) for lane in lanes]) for name in names}
    return ", ".join(f"{name.removeprefix(PROGRESS)} {number(value, 2)}" for name, value in means.items())


def main(words: Sequence[str] | None = None) -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=tasks(), nargs="+", default=tasks())
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--steps", type=amount, default=STEPS, help="environment steps of a lane")
    parser.add_argument("--tiny", action="store_true", help="two epochs of a few worlds, short episodes")
    parser.add_argument("--left", action="store_true", help="train nothing")
    parser.add_argument("--dir", type=Path, default=OUTPUTS / "progress", help="where the runs are kept")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args(words)
    for env in options.env:
        worlds, steps = get(env).recipe.worlds, options.steps
        if options.tiny:
            worlds, steps = 8, 8 * get(env).recipe.horizon * 2
        wanted = {"steps": steps, "worlds": worlds, "seeds": 1 if options.tiny else options.seeds}
        for arm in ARMS:
            study = read(options.out)
            entry = study.get(env, {**wanted, "arms": {}})
            if any(entry[key] != value for key, value in wanted.items()):
                raise SystemExit(f"{options.out} holds {env} with other settings; choose another --dir and --out.")
            if arm in entry["arms"]:
                continue
            if options.left:
                print(f"{env}, bonus={arm}: to do")
                continue
            entry["arms"][arm] = measure(env, arm, entry, options)
            keep(options.out, env, entry)
    show(TITLES, *rows(read(options.out)))


if __name__ == "__main__":
    main()
