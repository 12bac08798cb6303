"""The run's SQLite file: rows in, rows out.

The file may come from anybody. Its schema must be, to the letter, what the migrations make, so that no foreign trigger
or view runs. A row counts as changed where a value is not of its column's type, or a name could lead out of the
directory.
"""

from __future__ import annotations

import errno
import math
import os
import re
import sqlite3
import stat
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

from ..codec import DecodeError
from ..errors import NotBegun, StoreError
from ..parsing import command_line, short_path
from .schema import FILLS, MIGRATIONS, OLDEST

T = TypeVar("T")
Row = dict[str, Any]
"""A row, or a part of one, by the names of its columns."""
FILENAME = "run.sqlite"
LOCK = "run.lock"
LOG = "run.log"
"""The log of a run, for people."""
NOW = "run.now.json"
"""What a run is doing, while it is at work."""
SUMMARY = "run.summary.json"
"""How far a run has come, for lists of runs."""
STOP = "run.stop"
"""Exists while the run is asked to stop."""

MAX_VALUE = 64 << 20
"""Largest value in a row [bytes]."""
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,99}")
_NAMES = {"lane", "candidate", "start_lane"}
"""Columns whose values become names of files."""
_COUNTS = {"generation", "slot", "attempt", "attempts", "over_generation", "over_slot"}
_WORDS = re.compile(r"""--[^\n\0]*|'(?:[^']|'')*'|"(?:[^"]|"")*"|\w+|[^ \t\n\f\r]""")
"""Tokens of SQL. Only what SQLite takes for white space separates them: to it U+00A0, for example, is a letter."""
_TYPES: Mapping[str, tuple[type, ...]] = {"TEXT": (str,), "INTEGER": (int,), "REAL": (float, int)}

_FINISHED = """
WITH rejected AS (
        SELECT entries.candidate FROM remarks JOIN entries USING (generation, slot)
        WHERE kind = 'veto' AND remarks.id <= (SELECT MAX(remarks) FROM heard) AND entries.candidate IS NOT NULL),
    finished AS (
        SELECT lane FROM entries WHERE lane IS NOT NULL AND candidate NOT IN rejected
        -- Fitted numbers are no candidates of a search.
        UNION SELECT lane FROM lanes WHERE role = 'given' OR (role = 'tuned' AND NOT EXISTS (SELECT 1 FROM entries)))
"""
_GLANCE = f"""{_FINISHED},
    -- As `method.seeds.final_lanes` has it: a baseline's training beside the first generation counts as well.
    judged AS (
        SELECT reward, fitness FROM evaluations JOIN lanes USING (lane) WHERE role IN ('final', 'baseline', 'given')
            -- What trained after a search's first weighting compares numbers, not rewards.
            AND (lanes.rowid < COALESCE((SELECT MIN(rowid) FROM lanes WHERE role = 'tuned'), lanes.rowid + 1)
                OR NOT EXISTS (SELECT 1 FROM entries)))
SELECT
    (SELECT COUNT(DISTINCT generation) FROM entries) AS generations,
    COALESCE(
        -- As `score.played` has it: the best of a lane's policies, over all that it played.
        (SELECT MAX(fitness) FROM (
            SELECT SUM(plays.fitness * plays.episodes) / SUM(plays.episodes) AS fitness
            FROM plays WHERE lane IN finished AND fitness IS NOT NULL GROUP BY lane, peak)),
        (SELECT MAX(fitness) FROM results WHERE lane IN finished)
    ) AS fitness,
    (SELECT COUNT(*) FROM evaluations) AS evaluations,
    (SELECT COUNT(*) FROM ended) AS ended,
    (SELECT word FROM ended) AS word,
    (SELECT COUNT(*) FROM results) AS trainings,
    COALESCE(
        (SELECT AVG(fitness) FROM judged
            WHERE reward = (SELECT candidate FROM entries JOIN crown USING (generation, slot))),
        (SELECT MAX(fitness) FROM (
            SELECT AVG(fitness) AS fitness FROM judged WHERE NOT EXISTS (SELECT 1 FROM entries) GROUP BY reward))
    ) AS held_out,
    (SELECT AVG(fitness) FROM judged WHERE reward = 'human') AS human,
    TOTAL(cost_usd) AS cost_usd,
    CAST(TOTAL(prompt_tokens) AS INTEGER) AS prompt_tokens,
    CAST(TOTAL(completion_tokens) AS INTEGER) AS completion_tokens
FROM (SELECT cost_usd, prompt_tokens, completion_tokens FROM replies
    UNION ALL SELECT cost_usd, prompt_tokens, completion_tokens FROM proposals)
"""


@contextmanager
def explained(directory: Path) -> Generator[None]:
    """Turn what a person can cause (full disk, missing rights, a damaged file) into a StoreError."""
    try:
        yield
    except sqlite3.IntegrityError:
        raise  # a row written twice or changed is a mistake in this program
    except (OSError, sqlite3.Error) as error:
        raise StoreError(_sentence(directory, error)) from error


def _sentence(directory: Path, error: OSError | sqlite3.Error) -> str:
    directory = short_path(directory)
    number, text = getattr(error, "errno", None), str(error)
    if number in (errno.ENOSPC, errno.EDQUOT) or "disk is full" in text:
        return f"The disk that holds {directory} is full; free some space and continue."
    if number in (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP):
        return f"The file system of {directory} has no file locks, which a run needs; choose another folder."
    if isinstance(error, PermissionError) or number == errno.EROFS or "readonly" in text or "unable to open" in text:
        return f"{directory} cannot be written; check its permissions, work on a copy or choose another folder."
    if "not a database" in text or "malformed" in text:
        return f"{directory / FILENAME} is damaged or not a run; restore it from a copy or choose another folder."
    if isinstance(error, sqlite3.DataError):
        return f"{directory / FILENAME} holds a value that no run has; restore it from a copy or choose another folder."
    if "is locked" in text:
        return f"Another program is writing to {directory / FILENAME}; close it and try again."
    if number == errno.EFBIG or "disk I/O error" in text:  # the latter is all that SQLite says of a quota
        return f"{directory} cannot be read or written ({text}); check your disk quota and `ulimit -f`, and continue."
    return f"The run in {directory} cannot be read or written: {text}."


def _connect(directory: Path, writable: bool) -> sqlite3.Connection:
    """Connect in autocommit mode: `Database` begins and ends each transaction where a reader of the code sees it.

    Other processes write people's remarks, so a writer waits up to 30 s for another one to commit.
    """
    path = directory / FILENAME
    _expect_files(path)
    if path.exists():
        _expect_allowed(path, writable)
    elif writable:  # SQLite itself would make a file that a group may not write, whatever the umask
        with suppress(FileExistsError):
            path.touch(exist_ok=False)
    if not writable and not (os.access(directory, os.W_OK) and os.access(path, os.W_OK)):
        # A reader of a file in WAL mode makes its index beside it. Where that is not allowed, nobody writes either, so
        # the file may be opened as immutable. A reader who may write the folder alone could not remove the index again,
        # and its owner could not write it: the run would not go on.
        waiting, index = (path.with_name(f"{FILENAME}{suffix}") for suffix in ("-wal", "-shm"))
        if not waiting.exists():
            return sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True, isolation_level=None)
        if not index.exists():
            raise StoreError(
                f"{waiting} holds the last rows of a run that was killed, and reading it needs write access. "
                f"Copy {short_path(directory)}, and open the copy."
            )
    return sqlite3.connect(path, isolation_level=None, timeout=30.0)


def _expect_files(path: Path) -> None:
    """Refuse links, which SQLite follows, and whatever else is not a regular file."""
    for file in (path, *(path.with_name(f"{FILENAME}{suffix}") for suffix in ("-wal", "-shm", "-journal"))):
        if os.path.lexists(file) and not stat.S_ISREG(os.lstat(file).st_mode):
            raise StoreError(f"{short_path(file)} is a link or not a regular file; delete it or choose another folder.")


def _expect_allowed(path: Path, writable: bool) -> None:
    """Refuse a file that this user may not read or write. SQLite would notice it later, and leave an index."""
    if not os.access(path, os.R_OK):
        raise StoreError(f"{short_path(path)} cannot be read; check its permissions, or ask its owner for a copy.")
    if writable and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


@cache
def _layout(scripts: tuple[str, ...]) -> tuple[set[tuple[str, str]], dict[str, list[tuple[str, str, bool]]]]:
    """The schema that these scripts make: tables and triggers as pairs of name and SQL; and for each table its columns,
    with their types and whether they may be NULL."""
    with closing(sqlite3.connect(":memory:")) as model:
        for script in scripts:
            model.executescript(script)
        tables = [name for (name,) in model.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        columns = {
            table: [(name, kind, not (needed or key)) for _, name, kind, needed, _, key in rows]
            for table in tables
            if (rows := model.execute(f"PRAGMA table_info({table})").fetchall())
        }
        return _objects(model), columns


def _objects(connection: sqlite3.Connection) -> set[tuple[str, str]]:
    """Everything in the schema that SQL made. Names are no filter: a hostile one may begin like SQLite's own."""
    found = connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL")
    return {(str(name), _plain(str(sql))) for name, sql in found}


def _statements(script: str) -> Iterator[str]:
    """The statements of a script, one by one: `executescript` would end the transaction that it is called in."""
    statement = ""
    for line in script.splitlines(keepends=True):
        statement += line
        if sqlite3.complete_statement(statement):
            yield statement
            statement = ""


@lru_cache(256)
def _plain(sql: str) -> str:
    """SQL as SQLite reads it, without comments and extra space. A comment ends with its line: a longer one would hide
    the lines that follow.

    Cached, because nearly every file has the same tables.
    """
    return " ".join(word for word in _WORDS.findall(sql) if not word.startswith("--"))


def at_work(directory: Path) -> StoreError:
    """The error for a run that another process works on."""
    stop = command_line("stop", directory)
    return StoreError(f"Another process is working on {short_path(directory)}; wait for it, or stop it with: {stop}")


def never_began(directory: Path) -> NotBegun:
    """The error for a run that was killed before its settings were stored."""
    return NotBegun(
        f"{short_path(directory)} holds a run that never began; start it again with the same `eureka run` command."
    )


def changed_row(directory: Path, why: object) -> StoreError:
    """The error for a row that no run has written."""
    what = f"{short_path(directory / FILENAME)} holds a row that was changed ({why!s:.80})"
    return StoreError(f"{what}; restore the file from a copy or choose another folder.")


class Database:
    """Rows in, rows out. Values are plain; SQLite stores NaN as NULL.

    Args:
        migrate: whether a file of an older version is brought up to date; only the holder of the run's lock may do so.

    Raises:
        StoreError: see `explained`; also for a schema that is newer than this program, or too old for it.
    """

    def __init__(self, directory: Path, *, writable: bool, migrate: bool = True) -> None:
        self.directory = directory
        with explained(directory):
            self._connection = _connect(directory, writable)
            self._connection.row_factory = sqlite3.Row
            self._connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE)
            try:
                self._prepare(writable, migrate)
            except BaseException:
                self._connection.close()
                raise

    def _prepare(self, writable: bool, migrate: bool) -> None:
        self._connection.execute("PRAGMA trusted_schema = OFF")
        with self.moment():  # another process may be migrating
            schema, objects = self._schema(), _objects(self._connection)
        if schema > max(MIGRATIONS):
            raise StoreError(
                f"{short_path(self.directory)} was written by a newer openeureka; install that version to open it."
            )
        if 0 < schema < OLDEST:
            raise StoreError(
                f"{short_path(self.directory)} was written by a version of openeureka that is too old for this one; "
                "start again in another dir=."
            )
        if schema < 0 or objects != _layout(tuple(MIGRATIONS[n] for n in MIGRATIONS if n <= schema))[0]:
            raise StoreError(
                f"{short_path(self.directory / FILENAME)} has other tables than openeureka makes, so nothing in it "
                "is used; restore it from a copy or choose another folder."
            )
        if not writable:
            if schema == 0:
                raise never_began(self.directory)
            if schema < max(MIGRATIONS):
                self._to_memory()
                self._migrate()
            self._connection.execute("PRAGMA query_only = ON")
            return
        if self._connection.execute("PRAGMA quick_check(1)").fetchone()[0] != "ok":
            raise sqlite3.DatabaseError("malformed")
        self._connection.execute("PRAGMA journal_mode = WAL")
        # FULL syncs at every commit: a few hundred a run, and a reply that was paid for survives a power cut.
        self._connection.execute("PRAGMA synchronous = FULL")
        self._connection.execute("PRAGMA foreign_keys = ON")
        if migrate:
            self._migrate()

    def _to_memory(self) -> None:
        """Continue with a copy in memory: a reader must not change the file that it reads, not even to migrate it."""
        with closing(self._connection) as file:
            self._connection = sqlite3.connect(":memory:", isolation_level=None)
            self._connection.row_factory = sqlite3.Row
            file.backup(self._connection)

    def _schema(self) -> int:
        return self._connection.execute("PRAGMA user_version").fetchone()[0]

    def _migrate(self) -> None:
        """Run the missing scripts, all or none: a new file whose process is killed here must not seem to be too old."""
        if self._schema() == max(MIGRATIONS):
            return
        with self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            before = self._schema()  # another process may have been faster
            for number in (n for n in MIGRATIONS if n > before):
                for statement in _statements(MIGRATIONS[number]):
                    self._connection.execute(statement)
                if fill := FILLS.get(number):
                    fill(self._connection)
            self._connection.execute(f"PRAGMA user_version = {max(MIGRATIONS)}")

    def put(self, table: str, *rows: Mapping[str, Any]) -> None:
        """Insert rows, all or none, durable when this returns."""
        with explained(self.directory), self._connection:
            self._connection.execute("BEGIN IMMEDIATE")
            for row in rows:
                names, marks = ", ".join(row), ", ".join("?" * len(row))
                self._connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))

    def rows(self, table: str, *, order: Sequence[str] = ("rowid",), **where: Any) -> list[Row]:
        """Rows whose columns equal `where`."""
        condition = " AND ".join(f"{name} = ?" for name in where) or "1"
        query = f"SELECT * FROM {table} WHERE {condition} ORDER BY {', '.join(order)}"
        with explained(self.directory):
            found: list[Row] = [*map(dict, self._connection.execute(query, tuple(where.values())))]
        columns = _layout(tuple(MIGRATIONS.values()))[1][table]
        for row in found:
            for name, kind, optional in columns:
                if not _fits(name, kind, row[name], optional):
                    raise changed_row(self.directory, f"{name} of {table}: {row[name]!r:.40}")
        return found

    def row(self, table: str, **where: Any) -> Row | None:
        return next(iter(self.rows(table, **where)), None)

    def decoded(self, decode: Callable[..., T], *values: object) -> T:
        """Decode values of a row. Raises StoreError where they cannot be decoded."""
        try:
            return decode(*values)
        except (DecodeError, KeyError, TypeError) as error:
            raise changed_row(self.directory, error) from None

    def finished(self) -> set[str]:
        """Ids of the lanes that may lead the run: those of candidates that nobody rejected in finished generations, of
        given rewards and, in a run without a search, of weightings."""
        with explained(self.directory):
            return {row["lane"] for row in self._connection.execute(f"{_FINISHED} SELECT lane FROM finished")}

    @contextmanager
    def moment(self) -> Generator[None]:
        """Within it all reads see the rows of one moment, whatever another process adds."""
        with explained(self.directory):
            self._connection.execute("BEGIN")
        try:
            yield
        finally:
            with explained(self.directory):
                self._connection.execute("COMMIT")

    def glance(self) -> Row:
        """Counts and sums over the run, without its texts and curves."""
        with explained(self.directory):
            row: Row = dict(self._connection.execute(_GLANCE).fetchone())
        for name in ("fitness", "held_out", "human"):
            if not _fits(name, "REAL", row[name], True):
                raise changed_row(self.directory, f"{row[name]!r:.40} is no F")
        return row

    def close(self) -> None:
        self._connection.close()


class Log:
    """A part of a store: some tables, and the files that go with their rows."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._directory = database.directory


def _fits(name: str, kind: str, value: object, optional: bool) -> bool:
    """Whether a column may hold the value: SQLite itself lets any column hold anything."""
    if value is None:
        return optional
    if not isinstance(value, _TYPES[kind]) or (isinstance(value, float) and not math.isfinite(value)):
        return False
    if isinstance(value, str) and name in _NAMES:
        return _NAME.fullmatch(value) is not None
    return not (isinstance(value, int) and name in _COUNTS) or 0 <= value < 1_000_000
