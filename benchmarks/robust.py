"""What ranges are worth: F, in the task's own world and in hard ones, of a policy trained in one world (plain), trained
further there (longer), in ranges that nobody gave a reason for (uniform), and in those of `eureka robust` (ours). A
table of docs/guides/robot.md.

    python benchmarks/robust.py model=gpt-5                     # all that is missing, hours; model=random is the floor
    python benchmarks/robust.py model=gpt-5 --env ant --seed 1  # one of nine
    python benchmarks/robust.py model=gpt-5 start=scratch       # nine more, whose trainings begin anew
    python benchmarks/robust.py --tiny                          # minutes, to see that it works

The reward is the task's human one, so that only the worlds differ. The plain policy takes the task's own number of
steps, the others half of that from there, or all of it from scratch. A seed is kept in benchmarks/results/robust.json
once it is known. Runs are under outputs/robust/, and the same command goes on where it was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from intervals import interval_or_dash
from records import OUTPUTS, Record, command_line, keep, machine, read, results, show

import openeureka
from openeureka.cli.train import robust
from openeureka.config import BEST, SCRATCH, STARTS
from openeureka.numbers import spread
from openeureka.refine.hardened import LONGER, PLAIN, UNIFORM, Carried, RobustArm
from openeureka.report.view import RunView
from openeureka.stats import estimate, mean

ENVS = ("anymal", "ant", "quadcopter")
SEEDS = 3
BEGUN = {BEST: "with the best policy", SCRATCH: "from scratch"}
ARMS = (PLAIN, LONGER, UNIFORM, "ours")
RESULTS = results("robust")
TITLES = (
    "task", "trainings begin with", "seeds", *ARMS,
    "ours minus plain in hard worlds, 95 % interval", "uniform minus plain",
    "ours loses in its own world", "of plain's loss in hard worlds: ours", "uniform",
)  # fmt: skip


def measure(env: str, seed: int, directory: Path, words: Sequence[str], **settings: Any) -> Record:
    """One training in one world, the search for ranges, and how the policies do."""
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
        "arms": {name: _arm(arms[name]) for name in ARMS if name in arms},
        "before": _swept(found.before),
        "after": _swept(found.after),
    }


def refuse_other_settings(known: Mapping[str, Record], words: Sequence[str], name: str) -> None:
    """Refuse to mix seeds of different models or settings in one row.

    Raises:
        SystemExit: where those that are known had other settings.
    """
    for seed, found in known.items():
        if (own := _telling(found["settings"])) != _telling(words):
            raise SystemExit(f"Seed {seed} of {name} had {' '.join(own)}: take that, or remove it from {RESULTS}.")


def _telling(words: Sequence[str]) -> list[str]:
    """The settings, without those that find and pay the model, and without the start, which has its own rows."""
    others = ("base_url", "max_cost", "price", "start", "threads")
    return sorted(word for word in words if word.partition("=")[0] not in others)


def _arm(arm: RobustArm) -> Record:
    return {
        "nominal": arm.nominal.fitness if arm.nominal is not None else None,
        "hard": arm.hard,
        "worlds": {name: score.fitness for name, score in arm.worlds.items()},
    }


def _swept(found: Sequence[Carried]) -> dict[str, list[tuple[float, float | None]]]:
    return {one.name: [(value, fitness) for value, fitness, _ in one.points] for one in found}


def rows(measured: Mapping[str, Mapping[str, Mapping[str, Record]]]) -> list[list[str]]:
    """One row per task and start, over the seeds that are known."""
    return [
        _row(env, start, [*measured[start][env].values()])
        for env in ENVS
        for start in STARTS
        if measured.get(start, {}).get(env)
    ]


def drawn(measured: Mapping[str, Mapping[str, Mapping[str, Record]]]) -> Mapping[str, Mapping[str, Record]]:
    """For each task the seeds of the first start that has any, under the title that the figure gives them."""
    known = {env: [start for start in STARTS if measured.get(start, {}).get(env)] for env in ENVS}
    return {f"{env}, begun {BEGUN[starts[0]]}": measured[starts[0]][env] for env, starts in known.items() if starts}


def _row(env: str, start: str, seeds: Sequence[Record]) -> list[str]:
    shown = [arm for arm in ARMS if all(arm in seed["arms"] for seed in seeds)]
    of = {(arm, kind): [seed["arms"][arm][kind] for seed in seeds] for arm in shown for kind in ("nominal", "hard")}
    means = {key: mean(values) for key, values in of.items()}
    (nominal, share), (_, uniform) = losses(means, "ours"), losses(means, UNIFORM)
    both = [f"{spread(of[arm, 'nominal'])} / {spread(of[arm, 'hard'])}" if arm in shown else "-" for arm in ARMS]
    gained = [paired(of[arm, "hard"], of[PLAIN, "hard"]) for arm in ("ours", UNIFORM)]
    return [env, start, str(len(seeds)), *both, *gained, *map(_percent, (nominal, share, uniform))]


def paired(own: Sequence[float | None], other: Sequence[float | None]) -> str:
    """Mean difference and its interval over seeds: both scores of a seed share its luck."""
    pairs = zip(own, other, strict=True)
    return interval_or_dash(estimate([one - two for one, two in pairs if one is not None and two is not None]), 2)


def losses(means: Mapping[tuple[str, str], float | None], arm: str) -> tuple[float | None, float | None]:
    """What an arm loses against plain's F in its own world: there as a share of this F, in hard worlds as a share of
    what plain loses. Compared with its own F, a policy that is slow everywhere would seem to lose little."""
    plain, hard, own, own_hard = (means[which, kind] for which in (PLAIN, arm) for kind in ("nominal", "hard"))
    if plain is None or hard is None or own is None or own_hard is None:
        return None, None
    nominal = (plain - own) / abs(plain) if plain else None
    return nominal, (plain - own_hard) / (plain - hard) if plain > hard else None


def _percent(share: float | None) -> str:
    return f"{share:.0%}" if share is not None else "-"


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("words", nargs="*", help="settings of eureka robust, the model among them")
    parser.add_argument("--env", action="append", choices=ENVS, help="a task; may be repeated")
    parser.add_argument("--seed", action="append", type=int, help="may be repeated; 0, 1 and 2 by default")
    parser.add_argument("--tiny", action="store_true", help="short episodes and trainings of one task, kept nowhere")
    options = parser.parse_args()
    start = next((word.removeprefix("start=") for word in options.words if word.startswith("start=")), BEST)
    if options.tiny:
        words = options.words or ["model=random"]
        tiny = "quadcopter+episode_length=20"
        found = measure(tiny, 0, OUTPUTS / "robust" / f"tiny_{start}", [*words, "sample=2"], steps=2048, worlds=32)
        show(_row(tiny, start, [found]))
        return
    if not any(word.startswith("model=") for word in options.words):
        parser.error("no model is named: write model=gpt-5, or model=random for the floor")
    for env in options.env or ENVS:
        refuse_other_settings(read(RESULTS).get(start, {}).get(env, {}), options.words, f"{env}, start={start},")
        for seed in options.seed or range(SEEDS):
            if str(seed) in read(RESULTS).get(start, {}).get(env, {}):
                continue
            found = measure(env, seed, OUTPUTS / "robust" / f"{env}_{seed}_{start}", options.words)
            of_start = read(RESULTS).get(start, {})  # again: another task may have ended meanwhile
            seeds = dict(sorted({**of_start.get(env, {}), str(seed): found}.items()))
            keep(RESULTS, start, {**of_start, env: seeds})
            show(_row(env, start, [*seeds.values()]))


if __name__ == "__main__":
    main()
