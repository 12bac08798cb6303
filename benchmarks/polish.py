"""What does an eighth of the steps from a good policy reach against training from scratch? Does it rank rewards?

    python benchmarks/polish.py                                # Quadcopter, BallBalance, Ant; hours on 2 cores
    python benchmarks/polish.py --env ant --shares 0 0.1 0.25  # weights mixed with fresh ones, too

A strong model's rewards (`benchmarks/choosing/TASK.json`) and the human one train from scratch, with several seeds. The
policy of all that plays best is the parent. From it each reward trains again, with as many other seeds, as a lane of
`polish=N` does. A lane is worth what the best of its policies scores on held-out episodes, as it is. What is done is
in the store of a run under `outputs/polish/` and in `benchmarks/results/polish.json`, and is not repeated.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import choosing
from ledger import Script, in_sentences
from records import OUTPUTS, Record, amount, command_line, keep, machine, read, results, show

from openeureka.config import NO_MODEL, RunConfig
from openeureka.errors import ConfigError
from openeureka.method.lanes import Lanes
from openeureka.method.seeds import deal
from openeureka.numbers import number
from openeureka.refine.polishing import PARTS
from openeureka.runs.compose import comparing
from openeureka.score import played, rank
from openeureka.stats import mean, spearman
from openeureka.types import Lane, PolicyId, RewardProgram, Start

RESULTS = results("polish")
TASKS = ("quadcopter", "ballbalance", "ant")
AGAIN = 100
"""Added to the seed of a training from scratch, once for that from the parent with the first share, twice for the next.
"""

TITLES = (
    "task", "steps", "rewards, seeds", "from scratch: best reward, mean of all", "the parent", "fresh weights",
    "an eighth from the parent: best reward, mean of all", "rank correlation of both",
)  # fmt: skip


def measure(options: argparse.Namespace, env: str) -> None:
    """Train what is missing of a task, and write down what it scores."""
    steps = options.steps or choosing.STEPS[env]
    config = RunConfig(env=env, model=NO_MODEL, video="none", steps=steps)
    with comparing(config, OUTPUTS / "polish" / env, Script()) as lanes:
        log, rewards = lanes.store.lanes, choosing.programs(env, lanes.store)[-options.rewards :]
        for seed in options.seeds:
            judge(lanes, lanes.train(deal(rewards, [seed], "given")))
        parent = began(lanes)
        for place, share in enumerate(options.shares, start=1):
            for seed in options.seeds:
                wanted = carried(rewards, parent, share, seed + AGAIN * place)
                judge(lanes, lanes.train(wanted, steps=max(1, steps // PARTS)))
        lanes.store.end()
        scores = log.evaluations()
        records = {
            name: {
                "reward": lane.reward,
                "fresh": lane.start.fresh if lane.start is not None else None,
                "held_out": scores[name].fitness,
                "error": scores[name].error,
            }
            for name, lane in log.all().items()
            if name in scores
        }
    found = {"steps": steps, "parent": parent._asdict(), "lanes": records, **machine("cpu")}
    keep(options.out, env, found)


def judge(lanes: Lanes, ids: Mapping[str, object]) -> None:
    """Let policies play, and score the one that stands for each lane on held-out episodes."""
    lanes.play(ids)
    lanes.evaluate(lanes.counted_peaks(ids))


def began(lanes: Lanes) -> PolicyId:
    """The parent: the one that lanes began with already, or else the policy from scratch that plays best."""
    known, plays = lanes.store.lanes.all(), lanes.store.lanes.plays()
    for lane in known.values():
        if lane.start is not None:
            return lane.start.policy
    best = max(plays, key=lambda lane: rank(played(plays[lane], {}).fitness), default=None)
    if best is None:
        raise ConfigError("No policy from scratch ended an episode: train longer, with --steps.")
    return PolicyId(best, lanes.counted_peaks([best])[best])


def carried(
    rewards: Sequence[tuple[str, RewardProgram]], parent: PolicyId, share: float, seed: int
) -> list[tuple[Lane, RewardProgram]]:
    return [(Lane(name, seed, "polish", Start(parent, share)), program) for name, program in rewards]


# --- what it says ----------------------------------------------------------------------------------------------------


def rows(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """One row per task and share of fresh weights."""
    found: list[tuple[str, ...]] = []
    for env, task in study.items():
        lanes: Mapping[str, Record] = task["lanes"]
        scratch = _by_reward(lanes, None)
        seeds = max((len(values) for values in scratch.values()), default=0)
        for share in sorted({lane["fresh"] for lane in lanes.values() if lane["fresh"] is not None}):
            again = _by_reward(lanes, share)
            found.append(
                (
                    env,
                    f"{task['steps']:,}",
                    f"{len(scratch)}, {seeds}",
                    _cell(scratch),
                    number(lanes[task["parent"]["lane"]]["held_out"], 3),
                    f"{share:.0%}",
                    _cell(again),
                    _correlation(scratch, again),
                )
            )
    return found


Scores = Mapping[str, Sequence[float | None]]
"""Held-out F by reward, a value per seed."""


def _by_reward(lanes: Mapping[str, Record], fresh: float | None) -> Scores:
    found: dict[str, list[float | None]] = {}
    for lane in lanes.values():
        if lane["fresh"] == fresh:
            found.setdefault(lane["reward"], []).append(lane["held_out"])
    return found


def _cell(scores: Scores) -> str:
    means = [mean(values) for values in scores.values()]
    return f"{number(max(means, key=rank, default=None), 3)}, {number(mean(means), 3)}"


def _correlation(scratch: Scores, again: Scores) -> str:
    """Spearman's rank correlation over rewards, of means over seeds; a dash where one side is constant."""
    both = [name for name in scratch if name in again]
    found = spearman(*([rank(mean(scores[name])) for name in both] for scores in (scratch, again)))
    return "-" if found is None else f"{found:+.2f}"


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=choosing.STEPS, nargs="+", default=list(TASKS))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--shares", type=float, nargs="+", default=[0.0], help="of fresh weights")
    parser.add_argument(
        "--steps", type=amount, default=0, help="of each training from scratch, instead of choosing.py's"
    )
    parser.add_argument("--rewards", type=int, default=0, help="only the last so many, the human one among them")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    for env in options.env:
        with in_sentences():
            measure(options, env)
    show(TITLES, *rows(read(options.out)))


if __name__ == "__main__":
    main()
