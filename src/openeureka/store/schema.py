"""The tables of a run, version by version.

Every table is append-only, which triggers enforce: a row is written once, when the work it stands for is finished.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Mapping
from typing import cast


def _immutable(*tables: str) -> str:
    return "".join(
        f"CREATE TRIGGER {table}_{act} BEFORE {act} ON {table} "
        "BEGIN SELECT RAISE(ABORT, 'a finished row never changes'); END;\n"
        for table in tables
        for act in ("UPDATE", "DELETE")
    )


# The schema of a file is compared with these tables to the letter. So columns that were added later stand here in the
# way in which SQLite's ALTER TABLE writes them.
_TABLES = """
-- ranks: by what search=best ranks; NULL: by training.
CREATE TABLE run (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    config TEXT NOT NULL,
    version TEXT NOT NULL
    , ranks TEXT);
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
    lane TEXT PRIMARY KEY,
    fitness REAL,                    -- NULL where F was never defined
    result TEXT NOT NULL
);
CREATE TABLE entries (
    generation INTEGER NOT NULL,
    slot INTEGER NOT NULL,
    candidate TEXT REFERENCES verdicts (candidate),
    verdict TEXT NOT NULL,           -- kept here too: a reply without a program has one and no candidate
    lane TEXT REFERENCES results (lane),
    attempts INTEGER NOT NULL,
    feedback TEXT NOT NULL,
    PRIMARY KEY (generation, slot)
);
-- Here and in the other tables of scores, costs are those beside F; NULL: none were measured.
CREATE TABLE evaluations (
    lane TEXT PRIMARY KEY REFERENCES results (lane),
    fitness REAL,
    episode_length REAL,
    episodes INTEGER NOT NULL
    , error REAL, concentration REAL, peak TEXT, costs TEXT);
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
CREATE TABLE trials (
    lane TEXT NOT NULL REFERENCES results (lane),
    name TEXT NOT NULL,              -- in which world, or with which policy of the training
    fitness REAL,
    error REAL,
    concentration REAL,
    episode_length REAL,
    episodes INTEGER NOT NULL, peak TEXT, costs TEXT,
    PRIMARY KEY (lane, name)
);
CREATE TABLE plays (
    lane TEXT NOT NULL REFERENCES results (lane),
    peak TEXT NOT NULL,              -- which policy of the lane
    look INTEGER NOT NULL,           -- 0, then 1 where more episodes were needed
    fitness REAL,
    error REAL,
    concentration REAL,
    episode_length REAL,
    episodes INTEGER NOT NULL, costs TEXT,
    PRIMARY KEY (lane, peak, look)
);
CREATE TABLE crown (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    generation INTEGER NOT NULL,
    slot INTEGER NOT NULL
);
-- start_lane: whose policy it goes on from; NULL: it begins anew. start_fresh: share of fresh weights in the mixture.
-- ranges: by name, what its worlds are drawn from; NULL: as in the run.
CREATE TABLE lanes (
    lane TEXT PRIMARY KEY,
    reward TEXT NOT NULL,            -- a candidate, `human` or `sparse`, or what a given reward is called
    seed INTEGER NOT NULL,
    role TEXT NOT NULL               -- why it is trained, see types.Role
    , start_lane TEXT, start_peak TEXT, start_fresh REAL, ranges TEXT);
CREATE TABLE given (                 -- the rewards of a run that searches for none
    name TEXT PRIMARY KEY,
    candidate TEXT REFERENCES verdicts (candidate)   -- NULL for those that come with the task
);
CREATE TABLE slots (
    generation INTEGER NOT NULL,
    slot INTEGER NOT NULL,
    prompt INTEGER,                  -- first slot of the prompt that it answers; NULL for a given reward
    parent_generation INTEGER,       -- the candidate that the prompt asks to improve
    parent_slot INTEGER,
    PRIMARY KEY (generation, slot)
);
CREATE TABLE attempts (              -- what a reply was found to hold
    generation INTEGER NOT NULL,
    attempt INTEGER NOT NULL,
    slot INTEGER NOT NULL,
    candidate TEXT REFERENCES verdicts (candidate),
    repair TEXT,                     -- what the model was shown beyond the slot's prompt, of a repair
    PRIMARY KEY (generation, attempt, slot)
);
CREATE TABLE rungs (                 -- lanes that paused at a share of their steps
    lane TEXT NOT NULL REFERENCES lanes (lane),
    rung INTEGER NOT NULL,           -- 1 is the first
    went_on INTEGER NOT NULL,        -- whether it trained on; else others did
    fitness REAL,                    -- played there
    error REAL,
    concentration REAL,
    episode_length REAL,
    episodes INTEGER NOT NULL,
    peak TEXT, costs TEXT,
    PRIMARY KEY (lane, rung)
);
CREATE TABLE best_policy (                       -- judged as it is, whatever made it
    id INTEGER PRIMARY KEY CHECK (id = 1),
    lane TEXT NOT NULL REFERENCES results (lane),
    peak TEXT NOT NULL
);
CREATE TABLE ranges (
    name TEXT PRIMARY KEY,
    ranges TEXT NOT NULL
);
CREATE TABLE proposals (             -- what a model was asked for ranges, and what it replied
    slot INTEGER NOT NULL,
    attempt INTEGER NOT NULL,
    messages TEXT NOT NULL,
    text TEXT NOT NULL,
    model TEXT NOT NULL,
    prompt_tokens INTEGER NOT NULL,
    completion_tokens INTEGER NOT NULL,
    cost_usd REAL NOT NULL,
    seconds REAL NOT NULL,
    PRIMARY KEY (slot, attempt)
);
""" + _immutable(
    "run", "prompts", "replies", "verdicts", "results", "entries", "evaluations", "remarks", "heard", "trials",
    "plays", "crown", "lanes", "given", "slots", "attempts", "rungs", "best_policy", "ranges", "proposals",
)  # fmt: skip


def _of_scores(column: str) -> str:
    """SQL that adds a column to every table of scores."""
    return "".join(
        f"ALTER TABLE {table} ADD COLUMN {column}\n" for table in ("evaluations", "plays", "trials", "rungs")
    )


_SCREENS = """
CREATE TABLE screens (               -- accepted programs of a generation that asked for more than train
    generation INTEGER NOT NULL,
    slot INTEGER NOT NULL,
    kept INTEGER NOT NULL,           -- whether it trains
    agreement REAL,                  -- of its return with F, over recorded episodes
    error REAL,
    nearest_generation INTEGER,      -- which one that trains, or trained, pays most like it
    nearest_slot INTEGER,
    likeness REAL,                   -- how much so
    reason TEXT NOT NULL,            -- why it does not train
    PRIMARY KEY (generation, slot)
);
"""

_ENDED = """
CREATE TABLE ended (                 -- a search of which nothing is left but reports
    id INTEGER PRIMARY KEY CHECK (id = 1)
);
"""

_LOST = _of_scores("lost INTEGER NOT NULL DEFAULT 0;  -- episodes, as the physics broke down")

_NOISY = _of_scores("noisy INTEGER NOT NULL DEFAULT 0;  -- whether actions had the noise of training")

_WORD = "ALTER TABLE ended ADD COLUMN word TEXT;  -- what a search decided; NULL: nobody kept it\n"

MIGRATIONS: dict[int, str] = {
    11: _TABLES,
    12: _SCREENS + _immutable("screens"),
    13: _ENDED + _immutable("ended"),
    14: _LOST,
    15: _NOISY,
    16: _WORD,
}
"""Scripts by the number of the schema that they make. The first script starts from an empty file, every other one from
the schema before it. Published scripts are never edited, only followed by new ones."""

OLDEST = min(MIGRATIONS)
"""Schema of the oldest files that are read; the archives in benchmarks/ begin with it."""


# A file may come from anybody and may have been changed: values that do not fit are skipped.


def _settings(connection: sqlite3.Connection) -> dict[str, object] | None:
    """The stored settings of the run; empty before the run has any, None where they cannot be read."""
    row = connection.execute("SELECT config FROM run").fetchone()
    try:
        found: object = json.loads(row[0]) if row else {}
    except (ValueError, TypeError, RecursionError):
        return None
    return cast(dict[str, object], found) if isinstance(found, dict) else None


def fill_ended(connection: sqlite3.Connection) -> None:
    """Schema 13: mark the run as ended where its rows show that its last step is done."""
    settings = _settings(connection)
    if settings is None or not isinstance(iteration := settings.get("iteration", 0), int):
        return
    wanted = iteration + bool(settings.get("init"))
    given = settings.get("model") == "none"  # without generations, whatever `iteration` says

    def count(what: str) -> int:
        return connection.execute(f"SELECT COUNT({what}").fetchone()[0]

    tuned = (
        "*) FROM evaluations JOIN lanes USING (lane) JOIN given ON given.candidate = reward WHERE name <> 'original'"
    )
    last = "*) FROM best_policy" if settings.get("polish") else tuned if settings.get("tune") else "*) FROM evaluations"
    trained = "*) FROM entries JOIN results ON results.lane = entries.lane WHERE fitness IS NOT NULL"
    searched = not given and count("DISTINCT generation) FROM entries") >= wanted > 0
    if (given and count(last)) or (searched and (count(last) or not count(trained))):
        connection.execute("INSERT INTO ended VALUES (1)")


FILLS: Mapping[int, Callable[[sqlite3.Connection], None]] = {13: fill_ended}
"""Functions by the number of a schema. Each fills the tables that the schema adds from the older ones."""
