"""A run that is killed with SIGKILL and started again ends as if nothing had happened.

`benchmarks/crashes.py` kills at every point; these tests at every eleventh.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "crashes.py"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, dict[str, int]]]:
    out = tmp_path_factory.mktemp("crash") / "crash.json"
    subprocess.run([sys.executable, SCRIPT, "--stride", "11", "--out", out], check=True)
    return json.loads(out.read_text())["runs"]


@pytest.fixture
def outcomes(runs: dict[str, dict[str, dict[str, int]]]) -> dict[str, dict[str, int]]:
    return runs["search"]


@pytest.mark.parametrize(
    ("kind", "mode", "least"),
    [
        *(("search", "around", 25), ("search", "within", 40), ("search", "between", 6)),
        *(("train", "around", 9), ("train", "within", 18), ("train", "between", 1)),
        *(("halving", "around", 5), ("halving", "within", 10), ("halving", "between", 1)),
        *(("screen", "around", 12), ("screen", "within", 20), ("screen", "between", 2)),
        *(("polish", "around", 15), ("polish", "within", 30), ("polish", "between", 3)),
        *(("tune", "around", 20), ("tune", "within", 30), ("tune", "between", 3)),
    ],
)
def test_a_killed_run_ends_the_same(
    runs: dict[str, dict[str, dict[str, int]]], kind: str, mode: str, least: int
) -> None:
    found = runs[kind][mode]
    points = found["points"]
    assert points >= least
    assert (found["intact"], found["same_rows"], found["same_files"]) == (points, points, points)


def test_no_reply_that_was_committed_is_asked_for_again(outcomes: dict[str, dict[str, int]]) -> None:
    assert outcomes["around"]["replies_asked_again"] == 0
    assert outcomes["between"]["replies_asked_again"] == 0


def test_between_its_arrival_and_its_commit_a_reply_can_be_lost_and_is_asked_for_again(
    outcomes: dict[str, dict[str, int]],
) -> None:
    assert 0 < outcomes["within"]["replies_asked_again"] < outcomes["within"]["points"]
