"""The run's SQLite file: schema, migrations, and the only SQL of the package.

Every table is append-only, and triggers say so: a row is written once, when the work it stands for is finished.
"""

from __future__ import annotations

import errno
import os
import sqlite3
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from ..errors import StoreError

FILENAME = "run.sqlite"
LOCK = "run.lock"
LOG = "run.log"
"""How a run goes, in lines."""
STOP = "run.stop"
"""There while somebody wants the run to stop."""
AGAIN = "start it again with the same `eureka run` command."

_TABLES = """
CREATE TABLE run (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    config TEXT NOT NULL,
    version TEXT NOT NULL
);
CREATE TABLE prompts (
    generation INTEGER NOT NULL,
    slot INTEGER NOT NULL,           -- first slot that the prompt fills
    messages TEXT NOT NULL,
    PRIMARY KEY (generation, slot)
);
CREATE TABLE replies (
    generation INTEGER NOT NULL,
    attempt INTEGER NOT NULL,
    slot INTEGER NOT NULL,
    text TEXT NOT NULL,
    model TEXT NOT NULL,
    prompt_tokens INTEGER NOT NULL,
    completion_tokens INTEGER NOT NULL,
    cost_usd REAL NOT NULL,
    seconds REAL NOT NULL,
    PRIMARY KEY (generation, attempt, slot)
);
CREATE TABLE verdicts (
    candidate TEXT PRIMARY KEY,
    source TEXT NOT NULL,
    verdict TEXT NOT NULL
);
CREATE TABLE results (
    job TEXT PRIMARY KEY,
    fitness REAL,                    -- NULL where F was never defined
    result TEXT NOT NULL
);
CREATE TABLE entries (
    generation INTEGER NOT NULL,
    slot INTEGER NOT NULL,
    candidate TEXT REFERENCES verdicts (candidate),
    verdict TEXT NOT NULL,           -- kept here too: a reply without a program has one and no candidate
    job TEXT REFERENCES results (job),
    attempts INTEGER NOT NULL,
    feedback TEXT NOT NULL,
    PRIMARY KEY (generation, slot)
);
CREATE TABLE evaluations (
    job TEXT PRIMARY KEY REFERENCES results (job),
    fitness REAL,
    episode_length REAL,
    episodes INTEGER NOT NULL
);
"""

_REMARKS = """
CREATE TABLE remarks (
    id INTEGER PRIMARY KEY,
    kind TEXT NOT NULL,
    text TEXT NOT NULL,
    generation INTEGER, slot INTEGER,             -- the candidate it is about
    over_generation INTEGER, over_slot INTEGER    -- the other one of a vote
);
CREATE TABLE heard (
    generation INTEGER PRIMARY KEY,
    remarks INTEGER NOT NULL         -- all up to this id, less those of earlier generations, came after this one
);
"""


def _immutable(*tables: str) -> str:
    return "".join(
        f"CREATE TRIGGER {table}_{act} BEFORE {act} ON {table} "
        "BEGIN SELECT RAISE(ABORT, 'a finished row never changes'); END;\n"
        for table in tables
        for act in ("UPDATE", "DELETE")
    )


_TRIALS = """
ALTER TABLE evaluations ADD COLUMN error REAL;
ALTER TABLE evaluations ADD COLUMN concentration REAL;
CREATE TABLE trials (
    job TEXT NOT NULL REFERENCES results (job),
    name TEXT NOT NULL,              -- in which world, or with which policy of the training
    fitness REAL,
    error REAL,
    concentration REAL,
    episode_length REAL,
    episodes INTEGER NOT NULL,
    PRIMARY KEY (job, name)
);
"""

MIGRATIONS: list[str] = [
    _TABLES + _immutable("run", "prompts", "replies", "verdicts", "results", "entries", "evaluations"),
    _REMARKS + _immutable("remarks", "heard"),
    _TRIALS + _immutable("trials"),
]
"""Script n brings a file from schema n to n + 1. Published scripts are never edited, only followed by new ones."""


_GLANCE = """
SELECT
    (SELECT COUNT(DISTINCT generation) FROM entries) AS generations,
    (SELECT MAX(results.fitness) FROM results JOIN entries USING (job)) AS fitness,
    (SELECT COUNT(*) FROM evaluations) AS evaluations,
    TOTAL(cost_usd) AS cost_usd,
    CAST(TOTAL(prompt_tokens) AS INTEGER) AS prompt_tokens,
    CAST(TOTAL(completion_tokens) AS INTEGER) AS completion_tokens
FROM replies
"""


@contextmanager
def explained(directory: Path) -> Iterator[None]:
    """Turn what a person can cause (full disk, missing rights, a damaged file) into a StoreError."""
    try:
        yield
    except sqlite3.IntegrityError:
        raise  # a row written twice or changed is a mistake in this program
    except (OSError, sqlite3.Error) as error:
        raise StoreError(_sentence(directory, error)) from error


def _sentence(directory: Path, error: OSError | sqlite3.Error) -> str:
    if getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT) or "disk is full" in str(error):
        return f"The disk that holds {directory} is full; free some space and run the same command again."
    if isinstance(error, PermissionError) or "readonly" in str(error) or "unable to open" in str(error):
        return f"{directory} cannot be written; check its permissions or choose another dir=."
    if "not a database" in str(error) or "malformed" in str(error):
        return f"{directory / FILENAME} is damaged or not a run; restore it from a copy or choose another dir=."
    if "is locked" in str(error):
        return f"Another program is writing to {directory / FILENAME}; close it and run the same command again."
    return f"The run in {directory} cannot be read or written: {error}."


def _connect(directory: Path, writable: bool) -> sqlite3.Connection:
    """Transactions are left to `Database`, so that each one is visible where it matters.

    People's remarks come from other processes: a writer waits until the other one has committed.
    """
    path = directory / FILENAME
    for file in (path, *(path.with_name(f"{FILENAME}{suffix}") for suffix in ("-wal", "-shm", "-journal"))):
        if os.path.lexists(file) and not stat.S_ISREG(os.lstat(file).st_mode):
            raise StoreError(
                f"{file} is a link, or no regular file: a run has none; delete it, or choose another dir=."
            )
    waiting = path.with_name(f"{FILENAME}-wal")
    if not writable and not os.access(directory, os.W_OK) and not waiting.exists():
        # Readers of a file in WAL mode make its index beside it. Where they cannot, nobody writes either.
        return sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True, isolation_level=None)
    return sqlite3.connect(path, isolation_level=None, timeout=30.0)


class Database:
    """Rows in, rows out. Values are plain; NaN becomes NULL, as SQLite has it.

    Raises:
        StoreError: see `explained`; also for a schema newer than this program.
    """

    def __init__(self, directory: Path, *, writable: bool) -> None:
        self.directory = directory
        with explained(directory):
            self._connection = _connect(directory, writable)
            self._connection.row_factory = sqlite3.Row
            try:
                self._prepare(writable)
            except BaseException:
                self._connection.close()
                raise

    def _prepare(self, writable: bool) -> None:
        schema: int = self._connection.execute("PRAGMA user_version").fetchone()[0]
        if schema > len(MIGRATIONS):
            raise StoreError(f"{self.directory} was written by a newer openeureka; install that version to open it.")
        if not writable:
            if schema == 0:
                raise StoreError(f"{self.directory} holds a run that never began; {AGAIN}")
            if schema < len(MIGRATIONS):
                self._to_memory()
                self._migrate(schema)
            self._connection.execute("PRAGMA query_only = ON")
            return
        if self._connection.execute("PRAGMA quick_check(1)").fetchone()[0] != "ok":
            raise sqlite3.DatabaseError("malformed")
        self._connection.execute("PRAGMA journal_mode = WAL")
        # FULL syncs at every commit: a few hundred a run, and a reply that was paid for survives a power cut.
        self._connection.execute("PRAGMA synchronous = FULL")
        self._connection.execute("PRAGMA foreign_keys = ON")
        self._migrate(schema)

    def _to_memory(self) -> None:
        """Go on with a copy: an older file is for those to read who may not change it."""
        with closing(self._connection) as file:
            self._connection = sqlite3.connect(":memory:", isolation_level=None)
            self._connection.row_factory = sqlite3.Row
            file.backup(self._connection)

    def _migrate(self, schema: int) -> None:
        for number, script in enumerate(MIGRATIONS[schema:], start=schema + 1):
            self._connection.executescript(f"BEGIN IMMEDIATE; {script} PRAGMA user_version = {number}; COMMIT;")

    def put(self, table: str, *rows: Mapping[str, Any]) -> None:
        """Insert rows, all or none, durable when this returns."""
        with explained(self.directory):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                for row in rows:
                    names, marks = ", ".join(row), ", ".join("?" * len(row))
                    self._connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def rows(self, table: str, *, order: Sequence[str] = ("rowid",), **where: Any) -> list[sqlite3.Row]:
        """Rows whose columns equal `where`."""
        condition = " AND ".join(f"{name} = ?" for name in where) or "1"
        query = f"SELECT * FROM {table} WHERE {condition} ORDER BY {', '.join(order)}"
        with explained(self.directory):
            return self._connection.execute(query, tuple(where.values())).fetchall()

    def row(self, table: str, **where: Any) -> sqlite3.Row | None:
        found = self.rows(table, **where)
        return found[0] if found else None

    def glance(self) -> sqlite3.Row:
        """Counts and sums over the run, without its texts and curves."""
        with explained(self.directory):
            return self._connection.execute(_GLANCE).fetchone()

    def close(self) -> None:
        self._connection.close()
