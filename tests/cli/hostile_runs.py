"""Hostile run directories as data: what each holds, and what a person who uses it is told.

Each begins as a copy of an honest run that was interrupted after its first generation. Beside it lies a folder of the
person's own files, which it must not reach.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from report.policies import policy

from openeureka.training.policy import Policy

SECRET = "SECRET-CANARY-4711"
TASK = "open({mark!r}, 'a').write('imported ')\n"
"""A task file that leaves a mark when it is run."""
Harm = Callable[[Path, Path], None]
"""Changes a run (first path). The second path is the folder of the person's files."""


@dataclass(frozen=True, slots=True)
class HostileRun:
    """One directory from elsewhere."""

    name: str
    harm: Harm
    resume: str = ""
    """What `eureka resume` says when it refuses; empty where it goes on to the end."""
    read: str = ""
    """The same for show, report and the page."""
    verbs: tuple[str, ...] = ("show", "page", "play", "report", "resume")
    """Commands that are tried on the run, in this order."""


def bystanders(folder: Path) -> None:
    """Writes the person's files: a secret, a folder, another store, and a task file that leaves a mark when it runs."""
    (folder / "sub").mkdir(parents=True)
    (folder / "secret.txt").write_text(SECRET)
    (folder / "sub" / "precious.txt").write_text("a thesis")
    (folder / "task.py").write_text(TASK.format(mark=str(folder.parent / "mark")))
    (folder / "stages.yaml").write_text(f"- {{env: '{folder}/task.py:Task', steps: 10}}\n- {{steps: 10}}\n")
    with closing(sqlite3.connect(folder / "other.sqlite")) as other:
        other.execute("CREATE TABLE precious (words TEXT)")


def linked(name: str, target: str) -> Harm:
    """Puts a link at `name` to one of the person's files or folders."""

    def harm(run: Path, folder: Path) -> None:
        path = run / name
        if path.is_dir():
            os.rename(path, path.with_name(f"{path.name}.aside"))
        path.unlink(missing_ok=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(folder / target)

    return harm


def piped(name: str) -> Harm:
    """Puts a pipe at `name`: a process that opens it would wait forever."""

    def harm(run: Path, _: Path) -> None:
        (run / name).unlink(missing_ok=True)
        (run / name).parent.mkdir(parents=True, exist_ok=True)
        os.mkfifo(run / name)

    return harm


def edit(run: Path, sql: str, *values: object) -> None:
    """Change rows that the store's triggers protect, and leave the schema as it was."""
    with closing(sqlite3.connect(run / "run.sqlite")) as store:
        triggers = store.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            store.execute(f"DROP TRIGGER {name}")
        store.execute(sql, values)
        for _, text in triggers:
            store.execute(text)
        store.commit()


def rows(sql: str, *values: object) -> Harm:
    return lambda run, folder: edit(run, sql, *(v.format(folder=folder) if isinstance(v, str) else v for v in values))


def settings(**changes: object) -> Harm:
    """Changes the stored settings; `{folder}` stands for the folder of the person's files."""

    def harm(run: Path, folder: Path) -> None:
        with closing(sqlite3.connect(run / "run.sqlite")) as store:
            config = json.loads(store.execute("SELECT config FROM run").fetchone()[0])
        filled = {k: v.format(folder=folder) if isinstance(v, str) else v for k, v in changes.items()}
        edit(run, "UPDATE run SET config = ?", json.dumps(config | filled))

    return harm


def inside(table: str, column: str, **changes: object) -> Harm:
    """Changes values in the JSON of a column."""

    def harm(run: Path, _: Path) -> None:
        with closing(sqlite3.connect(run / "run.sqlite")) as store:
            found = store.execute(f"SELECT rowid, {column} FROM {table}").fetchall()
        for row, text in found:
            edit(run, f"UPDATE {table} SET {column} = ? WHERE rowid = ?", json.dumps(json.loads(text) | changes), row)

    return harm


def policy_that_names(env: str) -> Harm:
    def harm(run: Path, folder: Path) -> None:
        best = run / "best" / "policy.safetensors"
        best.write_bytes(Policy(env.format(folder=folder), policy(4, 1, (8,)).tensors).to_bytes())

    return harm


def schema(sql: str) -> Harm:
    def harm(run: Path, _: Path) -> None:
        with closing(sqlite3.connect(run / "run.sqlite")) as store:
            store.execute(sql)
            store.commit()

    return harm


def behind(sql: str, *values: object) -> Harm:
    """Changes the table in which SQLite keeps the schema, which SQLite hardly checks."""

    def harm(run: Path, _: Path) -> None:
        with closing(sqlite3.connect(run / "run.sqlite")) as store:
            store.execute("PRAGMA writable_schema = ON")
            assert store.execute(sql, values).rowcount == 1
            store.commit()

    return harm


def snapshot(about: str) -> Harm:
    def harm(run: Path, _: Path) -> None:
        (run / "snapshots").mkdir(exist_ok=True)
        (run / "snapshots" / "0123456789abcdef.json").write_text(about)

    return harm


_ONLY = ("resume",)
_LINK = "is a link or not a regular file"
_GONE = "is missing or damaged"
_ROW = "holds a row that was changed"
_TYPED = "would use settings that were never typed here"
_TABLES = "has other tables than openeureka makes"


def _peak(epoch: int) -> dict[str, object]:
    return {"epoch": epoch, "value": 1.0, "sha256": ""}


_ESCAPES = "\x1b]0;owned\x07\x1b[2J\u202e<script>alert(1)</script>\n# Heading [a](javascript:x)"
_HIDDEN = "INSERT INTO sqlite_master VALUES ('trigger', 'sqlite_later', 'remarks', 0, ?)"
"""Adds a trigger under a name that SQLite reserves for itself."""
_ENDLESS = """CREATE TRIGGER sqlite_later AFTER INSERT ON remarks BEGIN
    SELECT COUNT(*) FROM (WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n); END"""
_COMMENTED = """UPDATE sqlite_master SET sql = replace(sql, 'fills' || char(10), 'fills ')
    WHERE name = 'prompts' AND sql LIKE '%-- first slot that the prompt fills' || char(10) || '    messages TEXT%'"""
"""Removes the line break after a comment in the schema, so that the next column becomes part of the comment."""

CASES = (
    # Links. A write replaces a link that stands for a file, and is refused where a link stands for a folder.
    *(
        HostileRun(f"link-{name.replace('/', '-')}", linked(name, "secret.txt"))
        for name in (
            "report.html",
            ".report.html.0123456789abcdef.tmp",
            "best/video.mp4",
            "best/policy.onnx",
            "best/.reward.py.0123456789abcdef.tmp",
            "best/policy.safetensors",
            "lanes/human-s0/video.mp4",
            "run.log",
            "run.stop",
        )
    ),
    HostileRun("link-best", linked("best", "sub"), resume=_LINK),
    HostileRun("link-lanes", linked("lanes", "sub"), resume=_GONE),
    HostileRun("link-lane", linked("lanes/human-s0", "sub"), resume=_GONE),
    HostileRun("link-candidates", linked("candidates", "sub"), resume=_LINK),
    HostileRun("link-snapshots", linked("snapshots", "sub")),
    HostileRun("link-lock", linked("run.lock", "secret.txt"), resume=_LINK),
    HostileRun("link-store", linked("run.sqlite", "other.sqlite"), resume=_LINK, read=_LINK),
    HostileRun("link-wal", linked("run.sqlite-wal", "secret.txt"), resume=_LINK, read=_LINK),
    HostileRun("link-journal", linked("run.sqlite-journal", "secret.txt"), resume=_LINK, read=_LINK),
    HostileRun("pipe-log", piped("run.log")),
    HostileRun("pipe-lock", piped("run.lock"), resume=_LINK),
    HostileRun("pipe-policy", piped("best/policy.safetensors")),
    HostileRun("pipe-film", piped("lanes/human-s0/video.mp4")),
    HostileRun("pipe-store", piped("run.sqlite-wal"), resume=_LINK, read=_LINK),
    # Names that lead out of the directory.
    HostileRun("lane-outside", rows("UPDATE results SET lane = '../../things/sub' WHERE rowid = 1"), _ROW, _ROW),
    HostileRun("lane-absolute", rows("UPDATE results SET lane = ? WHERE rowid = 1", "{folder}/sub"), _ROW, _ROW),
    HostileRun("candidate-outside", rows("UPDATE entries SET candidate = '../../things/sub'"), _ROW, _ROW),
    HostileRun("entry-outside", rows("UPDATE entries SET lane = '../../things/sub'"), _ROW, _ROW),
    HostileRun("verdict-outside", inside("entries", "verdict", candidate="../../things/sub"), _ROW, _ROW),
    # Settings that reach outside.
    HostileRun("secret-in-address", settings(base_url="http://127.0.0.1:9/${{oc.env:CANARY}}/v1", model="m"), _TYPED),
    HostileRun("address", settings(base_url="http://127.0.0.1:9/v1", model="m"), _TYPED, verbs=_ONLY),
    HostileRun("model-that-costs", settings(model="gpt-5-pro"), _TYPED, verbs=_ONLY),
    HostileRun("model-file", settings(model="local:{folder}/secret.txt"), _TYPED, verbs=_ONLY),
    HostileRun("model-code", settings(model="task:main"), _TYPED, verbs=_ONLY),
    HostileRun("task-file", settings(env="{folder}/task.py"), _TYPED),
    HostileRun("task-class", settings(env="{folder}/task.py:Task"), _TYPED),
    HostileRun("task-module", settings(env="task:Task"), _TYPED),
    HostileRun("task-disguised", settings(env="cartpole+/../task.py"), _TYPED),
    HostileRun("search-module", settings(search="task:Search"), _TYPED),
    HostileRun("executor-module", settings(executor="task:Executor"), _TYPED),
    HostileRun("task-in-curriculum", settings(curriculum="{folder}/stages.yaml"), _TYPED),
    *(
        HostileRun(f"{name}-without-end", settings(env=env), verbs=("show", "page"))
        for name, env in (
            ("fitness", f"gym:CartPole-v1+fitness={'-' * 2000}x"),
            ("step", f"cartpole+control_dt={'1' * 400}"),
            ("episode", f"cartpole+episode_length={'1' * 400}"),
        )
    ),
    HostileRun("first-reward", settings(init="{folder}/secret.txt"), _TYPED, verbs=_ONLY),
    HostileRun("price", settings(price="0,0", max_cost=1.0), _TYPED, verbs=_ONLY),
    HostileRun("no-sandbox", settings(unsafe_no_sandbox=True)),
    HostileRun("task-of-policy", policy_that_names("{folder}/task.py:Task")),
    HostileRun("module-of-policy", policy_that_names("task:Task")),
    HostileRun("task-of-policy-disguised", policy_that_names("cartpole+/../task.py")),
    # Settings, rows and tables that no run has.
    HostileRun("setting-of-another-type", settings(sample="2"), _ROW, _ROW),
    HostileRun("slots-without-end", settings(sample=10**12), "settings unknown", "settings unknown"),
    HostileRun("seeds-without-end", settings(seeds=10**12), "settings unknown", "settings unknown"),
    HostileRun("generation-without-end", rows("UPDATE replies SET generation = 1000000000"), _ROW, _ROW),
    HostileRun("missing-generation", rows("UPDATE entries SET generation = 5"), _ROW, _ROW),
    HostileRun("missing-result", rows("UPDATE entries SET lane = 'elsewhere'"), _ROW, _ROW),
    HostileRun("text-as-number", rows("UPDATE replies SET cost_usd = 'much'"), _ROW, _ROW),
    HostileRun("infinite-time", rows("UPDATE replies SET seconds = 9e999"), _ROW, _ROW),
    HostileRun("infinite-curve", inside("results", "result", seconds=float("inf")), _ROW, _ROW),
    HostileRun("peak-after-the-end", inside("results", "result", best_reward=_peak(3)), _ROW, _ROW),
    HostileRun("curves-of-two-lengths", inside("results", "result", curves={
        "fitness": [1.0, 2.0], "reward": [1.0], "human_reward": [1.0, 2.0]}), _ROW, _ROW),
    HostileRun("digits-without-end", inside("entries", "verdict", findings=[
        {"rule": "a", "message": "b", "fix": "", "line": 10**4000}]), _ROW, _ROW),
    HostileRun("half-a-character", inside("results", "result", curves={"component/\ud800": [1.0]}), _ROW, _ROW),
    HostileRun("another-conversation", rows("UPDATE prompts SET messages = ?", '[{{"role": "user"}}]'), _ROW, _ROW),
    HostileRun("role-that-draws", rows("UPDATE prompts SET messages = ?", json.dumps(
        [{"role": _ESCAPES, "content": "x"}]).replace("{", "{{").replace("}", "}}")), _ROW, _ROW),
    HostileRun("trigger", schema("CREATE TRIGGER later AFTER INSERT ON replies BEGIN SELECT 1; END"), _TABLES, _TABLES),
    HostileRun("view", schema("CREATE VIEW later AS SELECT * FROM replies"), _TABLES, _TABLES),
    HostileRun("table", schema("CREATE TABLE later (words TEXT)"), _TABLES, _TABLES),
    HostileRun("trigger-of-sqlite", behind(_HIDDEN, _ENDLESS), _TABLES, _TABLES),
    HostileRun("column-in-a-comment", behind(_COMMENTED), _TABLES, _TABLES),
    HostileRun("snapshot-of-nothing", snapshot("[" * 100_000)),
    HostileRun("snapshot-of-another-form", snapshot('{"env": "cartpole", "lanes": {"a": 1}}')),
    # Text.
    HostileRun("model-that-draws", settings(model=_ESCAPES), _TYPED),
    HostileRun("reply-that-draws", rows("UPDATE replies SET model = ?", _ESCAPES)),
    HostileRun("feedback-that-draws", rows("UPDATE entries SET feedback = ?", _ESCAPES)),
)  # fmt: skip
