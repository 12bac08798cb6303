"""The oldest runs that still open: schema 11, here one from the archive of the headline table."""

from __future__ import annotations

import lzma
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from openeureka.cli.main import main
from openeureka.report.view import RunView
from openeureka.store import Store
from openeureka.store.db import FILENAME
from openeureka.store.schema import MIGRATIONS, OLDEST

ARCHIVE = Path(__file__).parents[2] / "benchmarks" / "headline" / "ballbalance.sqlite.xz"


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    (tmp_path / FILENAME).write_bytes(lzma.decompress(ARCHIVE.read_bytes()))
    assert schema(tmp_path) == OLDEST
    return tmp_path


def schema(directory: Path) -> int:
    with closing(sqlite3.connect(directory / FILENAME)) as file:
        return file.execute("PRAGMA user_version").fetchone()[0]


def test_it_is_shown_and_stays_as_it_is(directory: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit:
        main(["show", str(directory)])
    assert not exit.value.code and "02cf9aa760a5  1    338" in capsys.readouterr().out
    assert schema(directory) == OLDEST


def test_who_goes_on_with_it_brings_it_up_to_date(directory: Path) -> None:
    before = RunView.read(directory)
    with Store.open(directory, before.config) as store:
        assert store.ended, "no row of schema 11 says so"
        assert store.lanes.all() == before.lanes and store.ranks == "played"
    assert schema(directory) == max(MIGRATIONS)
