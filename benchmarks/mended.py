"""Ten prompts were wrong or left something out: what does a model write with better ones? docs/reference/headline.md.

    python benchmarks/mended.py              # what is missing of benchmarks/plans/mended.yaml; a day or two
    python benchmarks/mended.py --env ant    # one task

There are eight new replies in one generation, as in the table. The reward that wins and the human one then train with
nine seeds that chose neither. All ten tasks are asked again, however their row of the table ended. Runs are under
`outputs/mended/`; the store of each is kept in `benchmarks/mended/TASK.sqlite.xz`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import longer
from records import FOLDER, Record, read, results

PLAN = FOLDER / "plans" / "mended.yaml"
ARCHIVE = FOLDER / "mended"
RESULTS = results("mended")
TITLES = longer.titles("first prompt", "mended prompt")
left = partial(longer.left, plan=PLAN)
rows = partial(longer.rows, plan=PLAN)


def summary(measured: Mapping[str, Record]) -> str:
    """How many are at or above the human reward now; nothing before one is measured."""
    return f"With the mended prompts, {longer.reached(measured)}" if measured else ""


if __name__ == "__main__":
    longer.run(__doc__, PLAN, ARCHIVE, RESULTS)
    print(summary(read(RESULTS)))
