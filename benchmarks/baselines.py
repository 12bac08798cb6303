"""What the human and the sparse reward of every task reach: the two ends of the human-normalised score.

    python benchmarks/baselines.py                               # all tasks, three seeds; hours on 2 cores
    python benchmarks/baselines.py --env ant --seeds 5           # one task; seeds that are there are not trained again
    python benchmarks/baselines.py --env ant --device cuda       # on all GPUs
    python benchmarks/baselines.py --reward human --threads 1    # beside another such process, on other tasks

The rewards and seeds of a task are lanes of a run such as `eureka train` makes, under `outputs/baselines/`: the same
command goes on where it was interrupted, and `eureka ui outputs/baselines` shows it.
`benchmarks/results/baselines.json` is written after each task, and seeds that it holds are not trained again. Further
seeds of a task take as many steps. It is the table of docs/reference/baselines.md. The package ships its summary
(`src/openeureka/suite/baselines.json`): `eureka envs` shows it, and scores read it where the run did not train the
human and the sparse reward itself.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path

from lanes import PEAKS, by_reward, record, reward_and_seed
from ledger import differing, learn, whole
from records import OUTPUTS, ROOT, Record, amount, command_line, machine, read, results, write

from openeureka.config import TrainConfig
from openeureka.method.seeds import Wanted, deal
from openeureka.numbers import sparkline, spread
from openeureka.store import is_run
from openeureka.tasks import registry
from openeureka.types import OWN_REWARDS

RESULTS = results("baselines")
TITLES = (
    "task", "reward", "seeds", "steps of each", "first", "best", "held out",
    "curve", "minutes, lanes", "date",
)  # fmt: skip
SHIPPED = ROOT / "src" / "openeureka" / "suite" / "baselines.json"


def missing(entry: Record, seeds: int, rewards: Sequence[str] = OWN_REWARDS) -> list[Wanted]:
    """Lanes of a task that its record does not hold."""
    every = deal([(name, name) for name in OWN_REWARDS], range(seeds), "given")
    return [wanted for wanted in every if wanted[0].reward in rewards and wanted[0].id not in entry["lanes"]]


def settings(env: str, steps: int, worlds: int) -> Record:
    """What a number depends on besides its reward and seed."""
    recipe = registry.get(env).recipe
    return {
        "env_steps": steps or recipe.env_steps,
        "worlds": worlds or recipe.worlds,
        "recipe": whole(env),
    }


def measure(env: str, entry: Record, wanted: Sequence[Wanted], options: argparse.Namespace) -> Record:
    """One record per lane: of those wanted, and of those that an earlier call began."""
    config = TrainConfig(
        env=env,
        steps=entry["env_steps"],
        worlds=entry["worlds"],
        device=options.device,
        threads=options.threads,
        dir=str(options.dir / env),
    )
    learned = learn(config, PEAKS, wanted)
    fresh = {name: found for name, found in learned.items() if name not in entry["lanes"]}
    training = {
        "lanes": len(fresh),
        **({"threads": options.threads} if options.threads else {}),
        "minutes": round(max(result.seconds for result, _ in fresh.values()) / 60, 2),
        **machine(options.device),
    }
    return {name: {**record(*found), "training": training} for name, found in fresh.items()}


def summary(found: Record) -> Record:
    """What the package ships: F of every seed, and what it was measured with."""
    return {env: _summarised(entry) for env, entry in sorted(found.items()) if entry["lanes"]}


def _summarised(entry: Record) -> Record:
    lanes: Record = entry["lanes"]
    trainings = [lane["training"] for lane in lanes.values()]

    def scored(reward: str) -> Record:
        seeds = [lane for _, lane in sorted(by_reward(lanes).get(reward, {}).items())]
        return {
            "training": [lane["fitness_max_over_epochs"] for lane in seeds],
            "held_out": {peak: [lane[f"held_out_at_peak_of_{peak}"]["fitness"] for lane in seeds] for peak in PEAKS},
        }

    return {
        **{reward: scored(reward) for reward in OWN_REWARDS},
        "env_steps": entry["env_steps"],
        "worlds": entry["worlds"],
        "device": ", ".join(sorted({training["device"] for training in trainings})),
        "date": max(training["date"] for training in trainings),
    }


def rows(measured: Record) -> list[list[str]]:
    """One row per task and reward that trained."""
    known = {env: by_reward(measured[env]["lanes"]) for env in registry.names() if env in measured}
    return [
        [env, reward, *_row(list(lanes[reward].values()))]
        for env, lanes in known.items()
        for reward in OWN_REWARDS
        if reward in lanes
    ]


def _row(lanes: Sequence[Record]) -> list[str]:
    first, curve = lanes[0], lanes[0]["curves"]["fitness"][::2]
    return [
        str(len(lanes)),
        f"{first['env_steps']:,}",
        spread([lane["fitness_at_first"] for lane in lanes]),
        spread([lane["fitness_max_over_epochs"] for lane in lanes]),
        spread([lane["held_out_at_peak_of_fitness"]["fitness"] for lane in lanes]),
        sparkline(curve, len(curve)),
        f"{first['training']['minutes']:.0f}, {first['training']['lanes']}",
        first["training"]["date"],
    ]


def main(words: Sequence[str] | None = None) -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", action="append", choices=registry.names(), help="a task; may be repeated")
    parser.add_argument("--reward", action="append", choices=OWN_REWARDS, help="one of the two; may be repeated")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=amount, default=0, help="of a lane; 0: those that --out has, or the recipe's")
    parser.add_argument("--worlds", type=int, default=0, help="of a lane; 0 as with --steps")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="begin these tasks anew, also where a lane died")
    parser.add_argument("--dir", type=Path, default=OUTPUTS / "baselines", help="where the runs are kept")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--shipped", type=Path, help="the package's summary; none with another --out")
    options = parser.parse_args(words)
    shipped = options.shipped or (SHIPPED if options.out == RESULTS else None)
    for env in options.env or registry.names():
        found = read(options.out)
        known: Record = {} if options.again else found.get(env, {})
        steps, worlds = options.steps or known.get("env_steps", 0), options.worlds or known.get("worlds", 0)
        wanted = settings(env, steps, worlds)
        entry = {**wanted, "lanes": {}, **known}
        if options.again and is_run(options.dir / env):
            shutil.rmtree(options.dir / env)
        others = [key for key in ("env_steps", "worlds") if entry[key] != wanted[key]]
        if differing(entry["recipe"], wanted["recipe"]):
            others.append("recipe")
        if others:
            raise SystemExit(f"{options.out} holds {env} with another {' and '.join(others)}; --again replaces it.")
        entry["recipe"] = wanted["recipe"]
        lanes = missing(entry, options.seeds, options.reward or OWN_REWARDS)
        if not lanes:
            print(f"{env}: all is known")
            continue
        learned = measure(env, entry, lanes, options)
        # A lane that diverged is a result. One that died with its worker is not.
        done = entry["lanes"] | {name: lane for name, lane in learned.items() if lane["state"] != "failed"}
        entry["lanes"] = {name: done[name] for name in sorted(done, key=reward_and_seed)}
        found = dict(sorted({**read(options.out), env: entry}.items()))  # others may have written
        write(options.out, found)
        if shipped:
            write(shipped, summary(found))
        for name, lane in learned.items():
            held_out = lane["held_out_at_peak_of_fitness"]["fitness"]
            first, best = lane["fitness_at_first"], lane["fitness_max_over_epochs"]
            print(f"{env} {name}: F at first {first}, at best {best}, held out {held_out} {lane['message']}".rstrip())


if __name__ == "__main__":
    main()
