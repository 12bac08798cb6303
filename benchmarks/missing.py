"""Runs every long measurement that the pages still lack, one after another, at the lowest priority.

    python benchmarks/missing.py           # goes on until nothing is missing; days on 2 cores
    python benchmarks/missing.py --left    # what it would run, in its order

Each is a script of this folder that keeps what it finds in `benchmarks/results/` and repeats nothing, so this can be
stopped and begun again at any time. `make docs` then brings what is new into the pages, except from `progress.py` and
`polish.py`, which print their own tables. What needs a language model at an endpoint (`robust.py`, `generations.py`) is
not included.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator

import claims
import greedy
import longer
import make_run
import measurable
import mended
import polish
import progress
import prompts
import table
import tune
import untrained
import with_noise
from records import FOLDER, command_line, read

from openeureka.benchmark.plan import load


def left() -> Iterator[list[str]]:
    """The commands that would find something new, the quickest ways to a whole table first."""
    known = read(measurable.RESULTS)
    yield from (["measurable.py", "--env", env] for env in measurable.ENVS if env not in known)
    known = read(table.RESULTS)
    yield from (["headline.py", "--env", env] for env in load(table.PLAN).tasks if env not in known)
    yield from (["untrained.py", "--env", env] for env in untrained.left(known))
    yield from (["longer.py", "--env", env] for env in longer.left(read(longer.RESULTS)))
    yield from (["mended.py", "--env", env] for env in mended.left(read(mended.RESULTS)))
    yield from (["with_noise.py", "--env", env] for env in with_noise.left(read(with_noise.RESULTS)))
    yield from (["greedy.py", "--env", env] for env, row in read(greedy.RESULTS).items() if greedy.waits(row))
    yield from (["claims.py", "--env", env, "--groups", group] for env, group in claims.left(read(claims.RESULTS)))
    known = read(tune.RESULTS)
    yield from (
        ["tune.py", "--tasks", env, "--kinds", kind]
        for env in tune.TASKS
        for kind in tune.KINDS
        if f"{env}/{kind}/0" not in known
    )
    known = read(polish.RESULTS)
    yield from (["polish.py", "--env", env] for env in polish.TASKS if env not in known)
    known = read(progress.RESULTS)
    yield from (["progress.py", "--env", env] for env in progress.tasks() if progress.lacks(known.get(env)))
    yield from (["prompts.py", "--env", env, "--seeds", str(seed)] for env, seed in prompts.left(read(prompts.RESULTS)))
    yield from (["make_run.py", "--seeds", str(seed)] for seed in make_run.left(read(make_run.RESULTS)))


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--left", action="store_true", help="print the commands, run none")
    options = parser.parse_args()
    if options.left:
        print(*(shlex.join(["python", f"benchmarks/{script}", *words]) for script, *words in left()), sep="\n")
        return
    os.nice(19)
    tried: list[list[str]] = []
    while (command := next((one for one in left() if one not in tried), None)) is not None:
        tried.append(command)  # what fails now would fail again
        script, *words = command
        print(shlex.join(command), flush=True)
        subprocess.run([sys.executable, FOLDER / script, *words], check=False)


if __name__ == "__main__":
    main()
