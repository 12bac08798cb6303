"""A run that is killed with SIGKILL and started again ends as if nothing had happened.

`benchmarks/crashes.py` kills at every point; these tests at every 23rd.
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
    subprocess.run([sys.executable, SCRIPT, "--stride", "23", "--out", out], check=True)
    return json.loads(out.read_text())["runs"]


@pytest.fixture
def outcomes(runs: dict[str, dict[str, dict[str, int]]]) -> dict[str, dict[str, int]]:
    return runs["search"]


@pytest.mark.parametrize(
    ("kind", "mode", "least"),
    [
        *(("search", "around", 11), ("search", "within", 19), ("search", "between", 3)),
        *(("train", "around", 4), ("train", "within", 8), ("train", "between", 1)),
        *(("halving", "around", 2), ("halving", "within", 4), ("halving", "between", 1)),
        *(("screen", "around", 5), ("screen", "within", 9), ("screen", "between", 1)),
        *(("polish", "around", 7), ("polish", "within", 14), ("polish", "between", 1)),
        *(("tune", "around", 9), ("tune", "within", 14), ("tune", "between", 1)),
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
