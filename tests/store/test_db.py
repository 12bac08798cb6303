import errno
import math
import os
import sqlite3
from pathlib import Path

import pytest

from openeureka.errors import StoreError
from openeureka.store import artifacts, db
from openeureka.store.db import Database
from openeureka.store.schema import MIGRATIONS, OLDEST

NEWEST = max(MIGRATIONS)
TABLES = (
    "run", "prompts", "replies", "verdicts", "results", "entries", "evaluations", "remarks", "heard", "trials",
    "plays", "crown", "lanes", "given", "slots", "attempts", "rungs", "best_policy",
    "ranges", "proposals", "screens", "ended",
)  # fmt: skip
REPLY = {
    "generation": 0,
    "attempt": 0,
    "slot": 0,
    "text": "t",
    "model": "m",
    "prompt_tokens": 2_000_000,
    "completion_tokens": 1,
    "cost_usd": 0.0,
    "seconds": 0.0,
}


@pytest.fixture
def database(tmp_path: Path):
    opened = Database(tmp_path, writable=True)
    yield opened
    opened.close()


def schema(directory: Path) -> tuple[int, set[str]]:
    with sqlite3.connect(directory / db.FILENAME) as connection:
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        names = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        return version, {name for (name,) in names}


def test_a_blank_file_reaches_the_newest_schema(tmp_path: Path, database: Database) -> None:
    assert schema(tmp_path) == (NEWEST, set(TABLES))


def test_an_older_file_is_migrated_and_keeps_its_rows(
    tmp_path: Path, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    database.put("replies", REPLY)
    database.close()
    monkeypatch.setattr(db, "MIGRATIONS", MIGRATIONS | {NEWEST + 1: "CREATE TABLE extra (id INTEGER);"})
    newer = Database(tmp_path, writable=True)
    assert schema(tmp_path) == (NEWEST + 1, {*TABLES, "extra"})
    assert dict(newer.rows("replies")[0]) == REPLY
    newer.close()


def test_an_older_file_can_be_viewed_and_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as then:
        then.setattr(db, "MIGRATIONS", {OLDEST: MIGRATIONS[OLDEST]})
        older = Database(tmp_path, writable=True)
        older.put("replies", REPLY)
        older.close()
    viewed = Database(tmp_path, writable=False)
    assert dict(viewed.rows("replies")[0]) == REPLY
    assert viewed.rows("screens") == []
    viewed.close()
    assert schema(tmp_path)[0] == OLDEST


@pytest.mark.parametrize("writable", [False, True])
def test_a_file_that_is_too_old_is_refused_and_stays_as_it_is(
    tmp_path: Path, database: Database, writable: bool
) -> None:
    database.close()
    with sqlite3.connect(tmp_path / db.FILENAME) as connection:
        connection.execute(f"PRAGMA user_version = {OLDEST - 1}")
    with pytest.raises(StoreError, match=r"too old for this one; start again in another dir=\.$"):
        Database(tmp_path, writable=writable)
    assert schema(tmp_path)[0] == OLDEST - 1


def test_a_file_whose_maker_was_killed_half_way_is_begun_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(connection: sqlite3.Connection) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as then:
        then.setattr(db, "FILLS", {OLDEST + 1: killed})
        with pytest.raises(KeyboardInterrupt):
            Database(tmp_path, writable=True)
    Database(tmp_path, writable=True).close()
    assert schema(tmp_path)[0] == NEWEST


def test_a_migration_that_fails_leaves_the_old_schema(
    tmp_path: Path, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    database.close()
    failing = "CREATE TABLE extra (id INTEGER); CREATE TABLE run (id);"
    monkeypatch.setattr(db, "MIGRATIONS", MIGRATIONS | {NEWEST + 1: failing})
    with pytest.raises(StoreError):
        Database(tmp_path, writable=True)
    assert schema(tmp_path) == (NEWEST, set(TABLES))


def test_two_that_migrate_one_file_do_not_collide(
    tmp_path: Path, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    database.close()
    monkeypatch.setattr(db, "MIGRATIONS", MIGRATIONS | {NEWEST + 1: "CREATE TABLE extra (id INTEGER);"})
    prepared = Database._schema
    seen: list[int] = []

    def late(self: Database) -> int:
        seen.append(prepared(self))
        if len(seen) == 2:  # the first one has read the version, but not begun its transaction
            monkeypatch.setattr(Database, "_schema", prepared)
            Database(tmp_path, writable=True).close()
        return seen[-1]

    monkeypatch.setattr(Database, "_schema", late)
    Database(tmp_path, writable=True).close()
    assert seen == [NEWEST] * 2
    assert schema(tmp_path) == (NEWEST + 1, {*TABLES, "extra"})


def test_a_file_of_a_newer_version_is_refused(tmp_path: Path, database: Database) -> None:
    database.close()
    with sqlite3.connect(tmp_path / db.FILENAME) as connection:
        connection.execute(f"PRAGMA user_version = {NEWEST + 1}")
    with pytest.raises(StoreError, match="newer openeureka"):
        Database(tmp_path, writable=True)


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("change", ["UPDATE {} SET rowid = rowid", "DELETE FROM {}"])
def test_a_finished_row_never_changes(tmp_path: Path, database: Database, table: str, change: str) -> None:
    rows = {
        "run": {"id": 1, "config": "{}", "version": "0"},
        "prompts": {"generation": 0, "slot": 0, "messages": "[]"},
        "replies": REPLY,
        "verdicts": {"candidate": "a", "source": "", "verdict": "{}"},
        "results": {"lane": "a-s0", "fitness": 1.0, "result": "{}"},
        "entries": {"generation": 0, "slot": 0, "verdict": "{}", "attempts": 1, "feedback": ""},
        "evaluations": {"lane": "a-s0", "fitness": 1.0, "episode_length": 1.0, "episodes": 1},
        "remarks": {"kind": "words", "text": "too jerky"},
        "heard": {"generation": 0, "remarks": 1},
        "crown": {"id": 1, "generation": 0, "slot": 0},
        "plays": {"lane": "a-s0", "peak": "last", "look": 0, "episode_length": 1.0, "episodes": 1},
        "trials": {"lane": "a-s0", "name": "mass +10 %", "fitness": 1.0, "episode_length": 1.0, "episodes": 1},
        "lanes": {"lane": "a-s0", "reward": "a", "seed": 0, "role": "candidate"},
        "given": {"name": "human"},
        "slots": {"generation": 0, "slot": 0},
        "attempts": {"generation": 0, "attempt": 0, "slot": 0},
        "rungs": {"lane": "a-s0", "rung": 1, "went_on": 1, "episodes": 1},
        "best_policy": {"id": 1, "lane": "a-s0", "peak": "last"},
        "ranges": {"name": "r0", "ranges": "{}"},
        "ended": {"id": 1},
        "screens": {"generation": 1, "slot": 0, "kept": 0, "reason": "others differ more"},
        "proposals": {name: value for name, value in REPLY.items() if name != "generation"} | {"messages": "[]"},
    }
    database.put("results", rows["results"])
    if table == "rungs":
        database.put("lanes", rows["lanes"])
    if table != "results":
        database.put(table, rows[table])
    with (
        sqlite3.connect(tmp_path / db.FILENAME) as connection,
        pytest.raises(sqlite3.IntegrityError, match="a finished row never changes"),
    ):
        connection.execute(change.format(table))


def test_rows_are_inserted_all_or_none(database: Database) -> None:
    with pytest.raises(sqlite3.IntegrityError):
        database.put("replies", REPLY | {"slot": 1}, REPLY | {"slot": 1})
    assert database.rows("replies") == []


@pytest.mark.parametrize(
    ("table", "row"),
    [
        ("replies", REPLY | {"slot": -1}),
        ("replies", REPLY | {"slot": 1_000_000}),
        ("replies", REPLY | {"completion_tokens": "many"}),
        ("replies", REPLY | {"cost_usd": math.inf}),
        ("verdicts", {"candidate": None, "source": "", "verdict": "{}"}),  # which SQLite allows in a key
        ("verdicts", {"candidate": "../a", "source": "", "verdict": "{}"}),
    ],
)
def test_a_row_that_no_run_writes_is_not_read(database: Database, table: str, row: dict[str, object]) -> None:
    database.put(table, row)
    with pytest.raises(StoreError, match="holds a row that was changed"):
        database.rows(table)


@pytest.mark.parametrize(
    ("error", "advice"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "free some space"),
        (OSError(errno.EROFS, "Read-only file system"), "choose another folder"),
        (sqlite3.OperationalError("database or disk is full"), "free some space"),
        (PermissionError(errno.EACCES, "Permission denied"), "check its permissions"),
        (sqlite3.OperationalError("attempt to write a readonly database"), "check its permissions"),
        (sqlite3.OperationalError("disk I/O error"), "check your disk quota and `ulimit -f`"),
        (OSError(errno.EFBIG, "File too large"), "check your disk quota and `ulimit -f`"),
        (sqlite3.DatabaseError("database disk image is malformed"), "restore it from a copy"),
    ],
)
def test_what_a_person_can_cause_says_what_to_do(tmp_path: Path, error: Exception, advice: str) -> None:
    with pytest.raises(StoreError, match=advice), db.explained(tmp_path):
        raise error


def test_a_full_database_is_reported_and_loses_nothing(database: Database) -> None:
    database.put("replies", REPLY)
    pages = database._connection.execute("PRAGMA page_count").fetchone()[0]
    database._connection.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(StoreError, match="is full"):
        database.put("replies", REPLY | {"slot": 1, "text": "x" * 1_000_000})
    assert [row["slot"] for row in database.rows("replies")] == [0]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "new" / "reward.py"
    artifacts.write(path.parent, path.name, "old")

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(StoreError, match="is full"):
        artifacts.write(path.parent, path.name, "new")
    assert path.read_text() == "old"
    assert [entry.name for entry in path.parent.iterdir()] == ["reward.py"]


def test_a_new_folder_is_synced_in_the_one_that_holds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    monkeypatch.setattr("os.fsync", lambda descriptor: synced.append(os.readlink(f"/proc/self/fd/{descriptor}")))
    artifacts.write(tmp_path, "lanes/a-s0/last.safetensors", b"policy")
    # The parents of the two new folders, the file itself, and the folder with its name.
    assert synced[:2] == [str(tmp_path), f"{tmp_path}/lanes"]
    assert synced[-1] == f"{tmp_path}/lanes/a-s0"
    assert len(synced) == 4
    artifacts.write(tmp_path, "lanes/a-s0/curves.json", "{}")
    assert len(synced) == 6, "folders that existed are not synced again"


def test_two_writers_of_a_file_each_write_it_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []

    def slow(descriptor: int) -> None:
        monkeypatch.undo()  # the other writer begins and ends before the first one's rename
        artifacts.write(tmp_path, "report.html", "the other's")
        seen.append((tmp_path / "report.html").read_text())
        seen.extend(artifacts.names(tmp_path.parent, tmp_path.name))

    monkeypatch.setattr("os.fsync", slow)
    artifacts.write(tmp_path, "report.html", "the first one's")
    assert seen == ["the other's", "report.html"], "a file that is still being written is not listed"
    assert (tmp_path / "report.html").read_text() == "the first one's"
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_what_a_killed_writer_left_is_swept_and_one_at_work_keeps_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = tmp_path / "best" / ".reward.py.0123456789abcdef.tmp"
    left.parent.mkdir()
    left.write_text("def compute_rew")
    mine = tmp_path / "best" / ".mine.tmp"
    mine.touch()
    monkeypatch.setattr("os.fsync", lambda descriptor: artifacts.sweep(tmp_path))
    artifacts.write(tmp_path, "report.html", "whole")
    assert not left.exists()
    assert mine.exists()
    assert (tmp_path / "report.html").read_text() == "whole"
