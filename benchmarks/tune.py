"""What `eureka tune` makes of the rewards that people wrote, and of the same rewards with spoiled numbers.

    python benchmarks/tune.py                                   # Ant and Over; writes benchmarks/results/tune.json
    python benchmarks/tune.py --tasks ant --seed 1              # another seed of trainings and of spoiling
    python benchmarks/tune.py --confirm 9 --tasks shadow_hand_over --kinds spoiled
                                                                # nine more seeds of before and after, of those known

Spoiled numbers are the human ones times e**U(-2, 2); for a number that something is compared with, the exponent is a
tenth of that, as in tuning. The tuning of the human numbers trains these with the same fresh seeds, so the share of the
way back that was found is (after - spoiled) / (human - spoiled). Where before and after have more seeds, the human
reward's further seeds are those of `headline.py`, if it has some with as many steps. Each tuning is a run under
`outputs/tune/`; one that was killed goes on with the same command.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from random import Random

import fresh
from intervals import ends, interval
from records import OUTPUTS, Record, amount, command_line, keep, machine, once, read, results
from table import PLAN
from table import RESULTS as HEADLINE

import openeureka
from openeureka.benchmark.plan import load
from openeureka.method import race
from openeureka.numbers import spread
from openeureka.parsing import short_path
from openeureka.refine.tuned import ORIGINAL
from openeureka.reward.weights import weighed, weights
from openeureka.stats import defined, difference, mean
from openeureka.store import is_run
from openeureka.tasks import human
from openeureka.tasks.registry import get

RESULTS = results("tune")
TASKS = ("ant", "shadow_hand_over")
KINDS = ("human", "spoiled")
SPOILED = 2.0
"""The largest logarithm of a factor on a number."""

TITLES = (
    "task", "numbers", "steps", "seed", "F before, held out", "after", "difference, 95 % interval",
    "of the way back", "numbers that matter",
)  # fmt: skip


def spoiled(text: str, seed: int) -> str:
    """The text with each number multiplied by e**U(-2, 2)."""
    rng = Random(seed)
    return weighed(
        text,
        [
            float(f"{weight.value * math.exp(weight.step * rng.uniform(-SPOILED, SPOILED)):.4g}")
            for weight in weights(text)
        ],
    )


def measure(task: str, kind: str, options: argparse.Namespace) -> Record:
    """Do one tuning, or what is missing of it, and say what it found."""
    text = human.program(get(task))
    names = ("trials", "sample", "seeds", "seed", "worlds")
    settings = {name: getattr(options, name) for name in names}
    settings["steps"] = options.steps or load(PLAN).per_task[task]["steps"]
    run = openeureka.tune(
        task,
        text if kind == "human" else spoiled(text, options.seed),
        dir=OUTPUTS / "tune" / f"{task}_{kind}_{options.seed}",
        **settings,
    )
    found = run.tuned
    assert found is not None
    return {
        "settings": settings,
        "held_out": {
            name: list(found.finals[key].held_out)
            for name, key in (("before", ORIGINAL), ("after", found.after))
            if key in found.finals
        },
        "rivals": [list(own.held_out) for name, own in found.finals.items() if name not in (ORIGINAL, found.after)],
        "difference": ends(found.difference),
        "numbers": [
            {
                "name": effect.weight.name,
                "before": effect.weight.value,
                "after": effect.after,
                "trend": effect.trend.value if effect.trend is not None else None,
                "distance": effect.distance.value if effect.distance is not None else None,
                "matters": effect.matters,
            }
            for effect in found.effects
        ],
        "played": [trial.played for trial in found.trials],
        "components": {name: list(pair) for name, pair in found.components.items()},
        **machine("cpu", "cmaes"),
    }


def between(own: Record) -> list[float] | None:
    """The difference of after and before and the ends of its interval, as in `Tuned`, from what is kept of a tuning.

    The first tunings kept no scores of the rival, but the interval that pools its spread with those of the two. It is
    one of the two intervals of which `stats.difference` takes the wider.
    """
    before, after = (defined(own["held_out"].get(name, [])) for name in ("before", "after"))
    share = race.share(len(own["held_out"].get("after", [])), own["settings"]["seeds"])
    found = ends(difference(after, before, map(defined, own["rivals"]), claims=(1 + len(own["rivals"])) / share))
    if found is None:
        return None
    return max(found, own.get("pooled", found), key=lambda each: each[2] - each[1])


def confirm(name: str, options: argparse.Namespace) -> Record:
    """The reward before and after a tuning that is known, both trained with seeds that had no part in it.

    Raises:
        SystemExit: where its run is not here, which alone has the two texts.
    """
    directory = OUTPUTS / "tune" / name.replace("/", "_")
    if not is_run(directory):
        raise SystemExit(
            f"{short_path(directory)}, the run of this tuning, is missing: remove {name} from "
            f"{short_path(options.out)}, and the same command without --confirm tunes again."
        )
    run = openeureka.open_run(directory)
    found, config = run.tuned, run.config
    assert found is not None and found.after
    texts = {trial.name: trial.candidate.source for trial in found.trials}
    further = directory.with_name(f"{directory.name}_confirmed")
    trained = fresh.trained(config, (texts[ORIGINAL], texts[found.after]), further, options.confirm)
    before, after = trained.scores
    return {
        "seeds": trained.seeds,
        "held_out": {"before": before, "after": after},
        "difference": fresh.between(before, after),
        **machine("cpu", "cmaes"),
    }


def tuned(name: str, options: argparse.Namespace) -> str:
    """What a tuning found. One that is in the results is not repeated."""
    task, kind, _ = name.split("/")
    found = once(options.out, name, lambda: measure(task, kind, options))
    told = interval(*found["difference"], digits=3) if found["difference"] else "no interval"
    return f"known with {found['settings']['trials']} trials, {told}"


def again(name: str, options: argparse.Namespace) -> str:
    """What other seeds say of a tuning that is known; they train where there are none."""
    known = read(options.out)[name]
    found = known.get("confirmed")
    if found is None:
        found = confirm(name, options)
        keep(options.out, name, known | {"confirmed": found})
    return f"known with {len(found['seeds'])} seeds, {interval(*found['difference'], digits=3)}"


def way_back(own: Record, reference: Record) -> float | None:
    """Share of the way from the spoiled numbers to the human ones, by mean held-out F, whatever seeds each has."""
    before, after = (mean(own["held_out"].get(name, [])) for name in ("before", "after"))
    goal = mean(reference["held_out"].get("before", []))
    if before is None or after is None or goal is None or goal <= before:
        return None
    return (after - before) / (goal - before)


def human_again(row: Record, steps: int) -> Record | None:
    """The human reward with seeds that chose nothing, from a row of `headline.py` with as many steps."""
    scores = row.get("confirmed", {}).get("human")
    return {"held_out": {"before": scores}} if scores and row["steps"] == steps else None


def rows(results: Record, table: Record | None = None) -> list[list[str]]:
    """A row for each tuning, and one for the same two texts with more seeds where there are any.

    Args:
        table: the rows of `headline.py`; None for those that are measured.
    """
    other_seeds: Record = read(HEADLINE) if table is None else table
    found: list[list[str]] = []
    for name, own in sorted(results.items()):
        task, kind, seed = name.split("/")
        reference = results.get(f"{task}/human/{seed}", {"held_out": {}})
        matter = f"{sum(n['matters'] for n in own['numbers'])} of {len(own['numbers'])}"
        again = own.get("confirmed")
        told = [(kind, own, reference, matter)]
        if again:
            more = human_again(other_seeds.get(task, {}), own["settings"]["steps"]) or reference
            told.append((f"{kind}, {len(again['seeds'])} other seeds", again, more, "-"))
        for numbers, scores, goal, last in told:
            held_out, between = scores["held_out"], scores["difference"]
            share = way_back(scores, goal) if kind == "spoiled" else None
            row = (
                task,
                numbers,
                f"{own['settings']['steps']:,}",
                seed,
                spread(held_out.get("before", [])),
                spread(held_out.get("after", [])),
                interval(*between, digits=3) if between else "-",
                f"{share:.0%}" if share is not None else "-",
                last,
            )
            found.append(list(row))
    return found


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--tasks", default=",".join(TASKS), help="separated by commas")
    parser.add_argument("--kinds", default=",".join(KINDS), help="separated by commas")
    for name, default in (("trials", 32), ("sample", 8), ("seeds", 3), ("seed", 0), ("steps", 0), ("worlds", 0)):
        parser.add_argument(f"--{name}", type=amount, default=default)
    parser.add_argument("--confirm", type=fresh.several, default=0, help="fresh seeds for what is known already")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    names = [f"{task}/{kind}/{options.seed}" for task in options.tasks.split(",") for kind in options.kinds.split(",")]
    if options.confirm and (unknown := [name for name in names if name not in read(options.out)]):
        parser.error(f"{unknown[0]} is not measured yet: without --confirm it is.")
    for name in names:
        print(f"{name}: {again(name, options) if options.confirm else tuned(name, options)}", flush=True)


if __name__ == "__main__":
    main()
