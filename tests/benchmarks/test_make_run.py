"""The summary of several `make run`s: which of them count, and a note on those that share trainings."""

import json
from itertools import pairwise
from pathlib import Path

import make_run
import pytest


def test_its_seeds_share_no_training():
    # The run's own seed for its generations, then five fresh seeds for the final trainings.
    assert make_run.reach() == 6
    assert all(other - one >= make_run.reach() for one, other in pairwise(make_run.SEEDS))


def test_runs_of_other_seeds_count_until_its_own_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(make_run, "RESULTS", tmp_path / "make_run.json")

    def summary(*seeds: int) -> str:
        make_run.RESULTS.write_text(json.dumps({str(seed): {"verdict": "Not decided: F 2."} for seed in seeds}))
        return make_run.summary()

    start = "How {} runs of `make run` ended, with the seeds {}: *not decided* ({})."
    shared = "So runs whose seeds are neighbours share some of these trainings."
    assert summary(0, 1, 10).startswith(start.format(3, "0, 1, 10", 3)) and summary(0, 1, 10).endswith(shared)
    assert summary(0, 6, 20) == start.format(3, "0, 6, 20", 3)
    assert summary(0, 1, 2, 3, 10, 20, 30, 40) == start.format(5, "0, 10, 20, 30, 40", 5)
