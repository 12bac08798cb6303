"""Do later generations improve on the first? What finished searches say.

Tables of docs/reference/measurements.md and, of Gymnasium's environments, of docs/guides/gymnasium.md.

    eureka run env=quadcopter model=NAME base_url=... sample=8 iteration=2 steps=1500000 dir=outputs/quad
    python benchmarks/generations.py outputs/quad              # into benchmarks/results/generations.json
    python benchmarks/generations.py outputs/quad --fresh 5    # and trains its best reward and the human one five times
    make docs                                              # the tables
    eureka run ... model=replay:benchmarks/generations/quadcopter.json    # the same search again, for nothing

Scores are F of the best reward of each generation when its policy was played, and held-out F of fresh trainings. Where
the seeds of a search decide nothing, `--fresh` adds some that no reward was chosen by. The record of a search that is
known already is replaced.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

from fresh import several, trained
from intervals import interval_or_dash
from ledger import in_sentences
from records import FOLDER, Record, command_line, machine, read, results, today, write

import openeureka
from openeureka.benchmark import figures
from openeureka.benchmark.plan import Cell
from openeureka.config import short_name
from openeureka.numbers import number, spread
from openeureka.stats import difference, mean
from openeureka.store import read_replies
from openeureka.types import Generation

REPLIES = FOLDER / "generations"
RESULTS = results("generations")
TITLES = (
    "task", "model", "rewards a generation", "steps", "best of the first, played", "best of the later ones",
    "better by its error", "generated, held out", "human, held out", "seeds",
)  # fmt: skip
GYM = (
    "environment", "F", "rewards", "steps of each", "steps of all trainings", "minutes of training",
    "best of each generation, played", "generated, held out", "human, held out", "the verdict",
    "generated, further seeds", "human, further seeds", "difference, 95 % interval",
)  # fmt: skip
SEARCH = ("env", "model", "seed", "steps", "sample")
"""What tells one search from another."""


def best(generation: Generation) -> Record | None:
    """Place, F and its standard error of the reward that played best."""
    entry = generation.best
    if entry is None or entry.played is None:
        return None
    score = entry.played
    return {"place": str(entry.sample.place), "fitness": score.fitness, "error": score.error}


def scored(leading: list[Record | None]) -> list[Record]:
    """The scores whose F is defined."""
    return [score for score in leading if score is not None and score["fitness"] is not None]


def record(run: openeureka.Run) -> Record:
    """What a finished search found."""
    config, outcome = run.config, run.outcome
    if outcome is None:
        raise SystemExit(f"{run.directory} is not finished.")
    leading = [best(generation) for generation in run.history.generations]
    if len(scored(leading)) < 2:
        raise SystemExit(f"{run.directory} has no two generations whose best reward played, so none is compared.")
    return {
        "env": config.env,
        "model": config.model,
        "sample": config.sample,
        "steps": config.steps,
        "seed": config.seed,
        "best": leading,
        "generated": list(outcome.method.held_out),
        "human": list(outcome.human.held_out),
        "verdict": run.verdict,
        **spent(run),
        "date": today(),
    }


def spent(run: openeureka.Run) -> Record:
    """Steps and time of all trainings."""
    result = figures.read(Cell(run.config.env, run.config.model, run.config.seed), run.directory)
    assert result is not None
    return {"all_steps": result.steps, "minutes": round(result.minutes, 1), "device": machine("cpu")["device"]}


def again(run: openeureka.Run, seeds: int) -> Record:
    """Held-out F of the best reward and of the human one, with seeds that no reward was chosen by."""
    rewards = ["human", str(run.directory / "best" / "reward.py")]
    human, generated = trained(
        run.config, rewards, run.directory.with_name(f"{run.directory.name}_fresh"), seeds
    ).scores
    return {"generated": generated, "human": human}


def keep_replies(run: openeureka.Run) -> None:
    """Keep the replies for `model=replay:`. The file of a task's first search has the task's name; files of further
    searches have more words, which tell them apart."""
    config = run.config
    name = short_name(config.env.partition("+")[0])
    said = [reply.text for reply in read_replies(run.directory)]
    path = REPLIES / f"{name}.json"
    if path.exists() and read(path)["replies"] != said:
        own = "_".join(str(getattr(config, word)) for word in SEARCH if word != "env")
        path = REPLIES / f"{name}_{re.sub(r'[^A-Za-z0-9]+', '_', own)}.json"
    write(path, {"env": config.env, "model": config.model, "date": today(), "replies": said})


def gym_rows(records: list[Record]) -> list[tuple[str, ...]]:
    """One row per search on one of Gymnasium's environments."""
    return [_gym_row(one) for one in records if one["env"].startswith("gym:")]


def _gym_row(one: Record) -> tuple[str, ...]:
    name, _, fitness = one["env"].removeprefix("gym:").partition("+fitness=")
    played = ", ".join(number(score["fitness"] if score is not None else None) for score in one["best"])
    size = (f"{one['sample']} x {len(one['best'])}", f"{one['steps']:,}", f"{one['all_steps']:,}")
    said, _, apart = one["verdict"].removesuffix(".").partition(": ")
    between = apart.partition("held out; ")[2].partition(". ")[0]
    ends = spread(one["generated"]), spread(one["human"]), f"{said}: {between}" if between else said
    return (name, fitness or "return", *size, f"{one['minutes']:.0f}", played, *ends, *_further(one.get("fresh")))


def _further(found: Record | None) -> tuple[str, str, str]:
    if found is None:
        return "-", "-", "-"
    generated, human = found["generated"], found["human"]
    return spread(generated), spread(human), interval_or_dash(difference(generated, human))


def rows(records: list[Record]) -> list[tuple[str, ...]]:
    """One row per search."""
    return [_row(one) for one in records]


def summary(records: list[Record]) -> str:
    """In how many searches a later generation played better than the first."""
    better = sum(later["fitness"] > first["fitness"] for first, later in map(_leading, records))
    return (
        f"In {better} of {len(records)} searches a later reward plays better than the best of the first generation. "
        "Such a gain may vanish with fresh seeds."
    )


def _leading(one: Record) -> tuple[Record, Record]:
    """What played best of the first generation, and of the later ones."""
    first, *others = scored(one["best"])
    return first, max(others, key=lambda score: score["fitness"])


def _row(one: Record) -> tuple[str, ...]:
    first, later = _leading(one)
    error = math.hypot(first["error"] or 0.0, later["error"] or 0.0)  # none where all episodes come to the same
    apart = f"{(later['fitness'] - first['fitness']) / error:+.1f}" if error else "-"
    played = [f"{number(score['fitness'])} ± {number(score['error'], 2)}" for score in (first, later)]
    seeds = f"{len(one['generated'])}, {len(one['human'])}"
    size = (str(one["sample"]), f"{one['steps']:,}")
    held_out = [number(mean(own)) for own in (one["generated"], one["human"])]
    return (one["env"], one["model"], *size, *played, apart, *held_out, seeds)


def joined(known: list[Record], found: list[Record]) -> list[Record]:
    """All searches, each once, in its newest record. Fresh trainings stay where the best rewards are the same."""
    searches: dict[tuple[object, ...], Record] = {}
    for one in (*known, *found):
        before = searches.get(key := tuple(one[name] for name in SEARCH), {})
        kept = {"fresh": before["fresh"]} if "fresh" in before and before["best"] == one["best"] else {}
        searches[key] = {**kept, **one}
    return list(searches.values())


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("directories", type=Path, nargs="+")
    parser.add_argument(
        "--fresh", type=several, default=0, metavar="SEEDS", help="train the best and the human reward again"
    )
    options = parser.parse_args()
    with in_sentences():
        runs = [openeureka.open_run(directory) for directory in options.directories]
    found = [record(run) | ({"fresh": again(run, options.fresh)} if options.fresh else {}) for run in runs]
    write(RESULTS, joined(read(RESULTS), found))
    for run in runs:
        keep_replies(run)
