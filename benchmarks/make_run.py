"""What `make run` finds, over seeds: a table in docs/concepts/scores.md, a sentence in README.md.

    python benchmarks/make_run.py                    # seeds 0, 10, 20, 30, 40, about 7 minutes each on 2 cores
    python benchmarks/make_run.py --seeds 7          # another seed; what is done with these settings stays
    python benchmarks/make_run.py --markdown         # the table

The settings are those of the Makefile. Runs are kept under `outputs/make_run/`. A killed one goes on, but then its time
is not recorded. The figures go to `benchmarks/results/make_run.json`.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from records import OUTPUTS, ROOT, command_line, machine, read, results, write

from openeureka.config import RunConfig
from openeureka.method.seeds import unused_seed
from openeureka.numbers import number, spread
from openeureka.parsing import parse
from openeureka.report.tables import on_scale
from openeureka.report.verdict import verdict
from openeureka.report.view import RunView
from openeureka.score import SeedScores
from openeureka.strategies import Ranking
from openeureka.types import History

RESULTS = results("make_run")
SEEDS = (0, 10, 20, 30, 40)
"""A run trains with its own seed and some that follow, which no other of these takes."""
SEARCHED = "scoring on held-out episodes"
"""What a run says when its last training is done."""


def settings() -> list[str]:
    """The words of `make run`."""
    found = re.search(r"^RUN \?= (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert found is not None
    return found[1].split()


def reach() -> int:
    """Seeds that a run takes, its own among them."""
    config = parse(RunConfig, settings())
    return unused_seed(config) - config.seed


def left(measured: Mapping[str, Any], seeds: Sequence[int] = SEEDS) -> list[int]:
    """Seeds that have no run with these settings."""
    return [seed for seed in seeds if measured.get(str(seed), {}).get("settings") != " ".join(settings())]


def counted() -> dict[str, Any]:
    """The runs that the pages tell of: those of `SEEDS`, or, until each of these is measured, all that there are."""
    measured: dict[str, Any] = read(RESULTS)
    own = {seed: one for seed, one in measured.items() if int(seed) in SEEDS}
    return own if len(own) == len(SEEDS) else measured


def shared() -> str:
    """A sentence on the trainings that runs share; empty where they share none."""
    if all(later - seed >= reach() for seed, later in pairwise(sorted(map(int, counted())))):
        return ""
    return (
        f"A run trains the human reward with its own seed and up to {reach() - 1} that follow. "
        "So runs whose seeds are neighbours share some of these trainings."
    )


def measure(seed: int) -> dict[str, Any]:
    """Run a seed and read what came of it."""
    directory, began, searched = OUTPUTS / "make_run" / f"seed{seed}", time.monotonic(), 0.0
    continued = directory.exists()
    words = [*settings(), f"seed={seed}", f"dir={directory}", "video=none"]
    command = [Path(sys.executable).with_name("eureka"), "run", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            if SEARCHED in line:
                searched = time.monotonic() - began
    if process.returncode:
        raise SystemExit(process.returncode)
    minutes = {"search_minutes": searched / 60, "minutes": (time.monotonic() - began) / 60}
    return outcome(directory, **({} if continued else minutes))


def outcome(directory: Path, **minutes: float) -> dict[str, Any]:
    """What came of a finished run."""
    run = RunView.read(directory)
    found = run.outcome
    assert found is not None and run.best is not None
    history = run.history.generations
    winners = [Ranking(History(history[: index + 1])).best for index in range(len(history))]
    return {
        "settings": " ".join(settings()),
        **{name: round(value, 1) for name, value in minutes.items()},
        **machine("cpu"),
        "best_played_up_to_generation": [winner.score if winner else None for winner in winners],
        "human_played": run.baseline_score("human"),
        "crowned": str(run.best.place),
        "generated": _held_out(found.method),
        "runners_up": {str(place): _held_out(own) for place, own in found.rivals.items()},
        "human": _held_out(found.human),
        "sparse": _held_out(found.sparse),
        "score": on_scale(found),
        "verdict": verdict(run),
    }


def _held_out(own: SeedScores) -> list[float | None]:
    return list(own.held_out)


def markdown() -> str:
    """What is known as a table, with a column per seed."""
    measured = counted()
    rows = {
        "best of generation 0, F played": [
            number(one["best_played_up_to_generation"][0], 3) for one in measured.values()
        ],
        "best of both generations": [number(one["best_played_up_to_generation"][-1], 3) for one in measured.values()],
        "human reward, F played": [number(one["human_played"], 3) for one in measured.values()],
        "generated reward, F held out": [spread(one["generated"]) for one in measured.values()],
        "human reward, F held out": [spread(one["human"]) for one in measured.values()],
        "sparse reward, F held out": [spread(one["sparse"]) for one in measured.values()],
        "human-normalised score": [number(one["score"], 3) for one in measured.values()],
        "fresh seeds of the generated reward": [str(len(one["generated"])) for one in measured.values()],
        "minutes of search": [number(one.get("search_minutes"), 3) for one in measured.values()],
        "minutes with scoring and report": [number(one.get("minutes"), 3) for one in measured.values()],
    }
    lines = [["", *(f"seed {seed}" for seed in measured)], ["---"] * (len(measured) + 1)]
    return "\n".join(f"| {' | '.join(line)} |" for line in [*lines, *([name, *cells] for name, cells in rows.items())])


def printed() -> str:
    """The table and the verdict that the first of these runs ends with, without F in training."""
    one = next(iter(counted().values()))
    runners = {f"runner-up {place}": scores for place, scores in one["runners_up"].items()}
    scores = {"best generated": one["generated"], **runners, "human": one["human"], "sparse": one["sparse"]}
    rows = [("reward", "F, held out", "seeds")]
    rows += [(name, spread(own), str(len(own))) for name, own in scores.items()]
    table = "\n".join(f"{name:14}  {held_out:11}  {seeds}" for name, held_out, seeds in rows)
    return f"```\n{table}\n\n{one['verdict']}\n```"


def summary() -> str:
    """How the runs ended, in a sentence."""
    runs: list[Any] = list(counted().values())
    ends = Counter(one["verdict"].partition(":")[0] for one in runs)
    each = ", ".join(f"*{end[0].lower()}{end[1:]}* ({times})" for end, times in ends.most_common())
    seeds = ", ".join(counted())
    return f"How {len(runs)} runs of `make run` ended, with the seeds {seeds}: {each}. {shared()}".rstrip()


if __name__ == "__main__":
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    for seed in () if options.markdown else left(read(RESULTS), options.seeds):
        found = measure(seed)
        done = {**read(RESULTS), str(seed): found}
        write(RESULTS, dict(sorted(done.items(), key=lambda item: int(item[0]))))
    print(markdown())
