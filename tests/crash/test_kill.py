"""A run that is killed with SIGKILL and started again ends as if nothing had happened."""

import os
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from openeureka.store.db import FILENAME

TABLES = ("run", "prompts", "replies", "verdicts", "results", "entries", "evaluations", "remarks", "heard")
REPLIES = 14  # of the uninterrupted run: 3 + 1 + 1, 3, then 3 + 1 + 1 + 1


@pytest.fixture
def folder() -> Iterator[Path]:
    # A killed process needs no disk to test: the page cache outlives it, and memory makes the syncs of 100 runs free.
    place = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(dir=place) as name:
        yield Path(name)


def kill_and_resume(folder: Path, mode: str, stride: int) -> list[Path]:
    script = Path(__file__).with_name("scripted_run.py")
    subprocess.run([sys.executable, script, folder, mode, str(stride)], check=True, timeout=100)
    resumed = [path for path in folder.iterdir() if path.is_dir() and path.name != "whole"]
    assert len(resumed) >= 20
    return resumed


def rows(directory: Path) -> dict[str, list[tuple]]:
    with sqlite3.connect(directory / FILENAME) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return {table: sorted(connection.execute(f"SELECT * FROM {table}"), key=repr) for table in TABLES}


def files(directory: Path) -> dict[str, bytes]:
    found = (path for path in directory.rglob("*") if path.is_file() and path.parent != directory)
    return {str(path.relative_to(directory)): path.read_bytes() for path in found}


def asked(directory: Path) -> list[str]:
    return directory.with_suffix(".meter").read_text().split()


def test_killed_around_any_write_it_ends_the_same_and_asks_for_each_reply_once(folder: Path) -> None:
    for directory in kill_and_resume(folder, "around", stride=5):
        assert asked(directory) == [str(number) for number in range(REPLIES)]
        assert rows(directory) == rows(folder / "whole")
        assert files(directory) == files(folder / "whole")


def test_killed_within_any_write_it_ends_the_same_and_asks_again_for_at_most_the_reply_in_flight(folder: Path) -> None:
    for directory in kill_and_resume(folder, "within", stride=7):
        assert len(asked(directory)) <= REPLIES + 1
        assert rows(directory) == rows(folder / "whole")
        assert files(directory) == files(folder / "whole")
