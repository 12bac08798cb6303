"""What later generations are worth: each search once, and a row of each, whatever its errors are."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import generations

SEARCH = {"env": "ant", "model": "claude", "seed": 0, "steps": 1000, "sample": 8}


def search(first: tuple[float, float], later: tuple[float, float], **other: Any) -> dict[str, Any]:
    best = [{"place": f"g{g}s0", "fitness": f, "error": e} for g, (f, e) in enumerate((first, later))]
    return {**SEARCH, "best": best, "generated": [1.0, 2.0], "human": [1.0], **other}


def test_a_search_that_is_measured_again_is_in_the_table_once():
    old, other = search((1.0, 0.1), (2.0, 0.1)), search((1.0, 0.1), (2.0, 0.1), seed=1)
    new = search((1.0, 0.1), (2.0, 0.1), fresh={"generated": [1.0, 2.0], "human": [0.0, 1.0]})
    assert generations.joined([old, other], [new]) == [new, other]


def test_the_gain_is_told_by_its_error_where_there_is_one():
    assert "+5.0" in generations.rows([search((1.0, 3.0), (26.0, 4.0))])[0]
    assert "-" in generations.rows([search((0.0, 0.0), (1.0, 0.0))])[0]
