"""What older versions did not keep, worked out once from what they did.

A file may come from anybody and may have been changed: what does not fit is left out, and whoever reads the row that it
came from says so.
"""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Mapping

from ..reward import extract
from ..types import Candidate

_LANE = re.compile(r"(?P<reward>[A-Za-z0-9_][A-Za-z0-9_-]{0,80})-s(?P<seed>\d{1,10})")
_BESIDE = ("human", "sparse")


def fill_ledger(connection: sqlite3.Connection) -> None:
    """Schema 5: every lane with its role, the program of every reply, the prompt and the parent of every slot."""
    _fill_lanes(connection)
    _fill_attempts(connection)
    _fill_slots(connection)


def _fill_lanes(connection: sqlite3.Connection) -> None:
    """A search trained with the run's seed, the final trainings with others."""
    config = connection.execute("SELECT config FROM run").fetchone()
    try:
        own = json.loads(config[0]).get("seed", 0) if config else 0
    except (ValueError, TypeError, AttributeError, RecursionError):
        return
    for (job,) in connection.execute("SELECT job FROM results ORDER BY rowid").fetchall():
        if (match := _LANE.fullmatch(str(job))) is None:
            continue
        reward, seed = match["reward"], int(match["seed"])
        role = "final" if seed != own else "baseline" if reward in _BESIDE else "candidate"
        connection.execute("INSERT INTO lanes VALUES (?, ?, ?, ?)", (job, reward, seed, role))


def _fill_attempts(connection: sqlite3.Connection) -> None:
    judged = {name for (name,) in connection.execute("SELECT candidate FROM verdicts")}
    replies = connection.execute("SELECT generation, attempt, slot, text FROM replies ORDER BY rowid").fetchall()
    for *place, text in replies:
        source = extract.program(text) if isinstance(text, str) else None
        candidate = Candidate.of(source).id if source is not None else None
        if candidate is None or candidate in judged:  # else the run ended before it was judged
            connection.execute("INSERT INTO attempts VALUES (?, ?, ?, ?, NULL)", (*place, candidate))


def _fill_slots(connection: sqlite3.Connection) -> None:
    """A prompt fills the slots from its own up to the next one's."""
    prompts = connection.execute("SELECT * FROM prompts ORDER BY generation, slot").fetchall()
    programs = {
        str(source).strip(): name for name, source in connection.execute("SELECT candidate, source FROM verdicts")
    }
    replied = "SELECT DISTINCT generation, slot FROM replies ORDER BY generation, slot"
    for generation, slot in connection.execute(replied).fetchall():
        asked = [row for row in prompts if row[0] == generation and row[1] <= slot]
        _, first, messages, *parent = asked[-1] if asked else (0, None, "", None, None)
        if parent[0] is None:
            parent = _shown(connection, programs, generation, messages)
        row = (generation, slot, first, *parent)
        connection.execute("INSERT INTO slots VALUES (?, ?, ?, ?, ?)", row)


def _shown(
    connection: sqlite3.Connection, programs: Mapping[str, str], generation: int, messages: str
) -> tuple[int | None, int | None]:
    """Where the program comes from that a prompt shows last as the model's own answer."""
    try:
        answers = [m["content"] for m in json.loads(messages or "[]") if m["role"] == "assistant"]
        program = answers[-1].removeprefix("```python\n").removesuffix("\n```").strip()
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError):
        return None, None
    earlier = (
        "SELECT generation, slot FROM entries WHERE candidate = ? AND generation < ? ORDER BY generation DESC, slot"
    )
    return connection.execute(earlier, (programs.get(program), generation)).fetchone() or (None, None)
