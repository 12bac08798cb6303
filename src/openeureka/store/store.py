"""The store of a run: what is finished, and nothing else. The directory is the run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import asdict
from glob import glob
from pathlib import Path
from typing import TypeVar

from filelock import FileLock

from ..codec import convert, decode, encode
from ..config import FREE_TO_CHANGE, NO_MODEL, RunConfig
from ..errors import ConfigError, NotBegun, StoreError
from ..parsing import restored, short_path
from ..score import played
from ..text import safe_text
from ..types import (
    Candidate,
    Evaluation,
    Generation,
    Glance,
    Hardening,
    History,
    Place,
    PolicyId,
    Ranks,
    Sample,
    Scored,
    TrainingResult,
    Word,
)
from ..version import __version__
from . import artifacts, summary
from .db import FILENAME, Database, Row, changed_row, never_began
from .folders import Folders
from .hold import expect_near, hold
from .lane_log import LaneLog
from .remarks import RemarkLog
from .rewards import RewardLog
from .rows import decode_place, decode_usage, decode_verdict, encode_place
from .slots import ScreenLog, TalkLog

T = TypeVar("T")
NAME_IT = "name the directory that `eureka run` printed"
HARDENING = "robust.json"
"""Not in `robust/`, whose files are deleted when another policy takes their place."""


def expect_same(directory: Path, stored: RunConfig, wanted: RunConfig) -> None:
    """Raises StoreError where a run was begun with other settings than those wanted now, except such as may change."""
    before, now = asdict(stored), asdict(wanted)
    directory = short_path(directory)
    if (stored.model == NO_MODEL) != (wanted.model == NO_MODEL):
        held = "trainings of given rewards" if stored.model == NO_MODEL else "a search"
        raise StoreError(f"{directory} holds {held}, but this is a run of another kind; choose another dir=.")
    differing = [key for key in now if key not in FREE_TO_CHANGE and before[key] != now[key]]
    if differing:
        changes = ", ".join(f"{key}={now[key]} (was {before[key]})" for key in differing)
        raise StoreError(
            f"{directory} holds a run with other settings: {changes}. Leave them out, or give a new run another dir=."
        )


class Store:
    """Everything that a run has finished, readable at once and never changed afterwards.

    Files are written before the row that stands for them, so no row lacks its file. Writing the same thing twice is a
    programming error and raises sqlite3.IntegrityError.

    Attributes:
        folders: where people look for policies.
        lanes: what trained, and what came of it.
        remarks: what a person says while the run goes on.
        rewards: programs, their verdicts and their names.
        screens: which programs do not train, and why.
        talk: what the model was asked, and what it replied.
    """

    def __init__(self, directory: Path, database: Database, lock: FileLock | None) -> None:
        self.directory = directory
        self._database = database
        self._lock = lock
        self.lanes = LaneLog(database)
        self.folders = Folders(database, self.lanes)
        self.remarks = RemarkLog(database)
        self.rewards = RewardLog(database)
        self.screens = ScreenLog(database)
        self.talk = TalkLog(database)

    @classmethod
    def open(cls, directory: Path | str, config: RunConfig, ranks: Ranks = "played") -> Store:
        """Begin a run, or continue the one that is there. No other process can until `close`.

        Args:
            ranks: by which F the search ranks candidates; stored when the run begins.

        Raises:
            StoreError: when another process works on the run, the directory holds something else, or settings differ.
        """
        directory = Path(directory)
        artifacts.expect_room(directory)
        lock = hold(directory)
        with ExitStack() as undo:
            undo.callback(lock.release)
            database = Database(directory, writable=True)
            undo.callback(database.close)
            store = cls(directory, database, lock)
            store._settle(config, ranks)
            artifacts.sweep(directory)
            undo.pop_all()
        return store

    @classmethod
    def view(cls, directory: Path | str) -> Store:
        """Open a run for reading, also while a process works on it: see `moment`.

        Raises:
            StoreError: when there is none, or it is at work on another machine.
        """
        directory = Path(directory)
        if not os.path.isfile(directory / FILENAME):
            raise NotBegun(f"{short_path(directory)} is not a run: {_missing(directory)}.")
        expect_near(directory)
        return cls(directory, Database(directory, writable=False), None)

    @classmethod
    def visit(cls, directory: Path | str) -> Store:
        """Open a run that another process may be working on, to add remarks: only these are written without the lock.

        Use nothing but `remarks`: a run of an older version keeps its old tables, the only ones that its process knows.

        Raises:
            StoreError: when that process is on another machine.
        """
        expect_near(Path(directory))
        return cls(Path(directory), Database(Path(directory), writable=True, migrate=False), None)

    def moment(self) -> AbstractContextManager[None]:
        """Within it all reads see the rows of one moment. Otherwise a run at work may add rows between two reads."""
        return self._database.moment()

    def close(self) -> None:
        if self._lock is None:
            self._database.close()
            return
        with ExitStack() as undo:
            undo.callback(self._lock.release)
            stand = None
            with suppress(StoreError):
                stand = self.config, self.glance()
            self._database.close()
            if stand is not None:
                summary.keep(self.directory, *stand)

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- settings ----------------------------------------------------------------------------------------------------

    def _settle(self, config: RunConfig, ranks: Ranks) -> None:
        """Store the settings before anything else. A process that continues the run must come with the same ones."""
        if self._database.row("run") is None:
            if artifacts.is_foreign(self.directory):
                raise StoreError(
                    f"{short_path(self.directory)} has files of a run whose {FILENAME} is missing; restore it from a "
                    "copy, together with its -wal file, or choose another dir=."
                )
            row = {"id": 1, "config": encode(config), "version": __version__, "ranks": ranks}
            self._database.put("run", row)
            return
        expect_same(self.directory, self.config, config)

    @property
    def config(self) -> RunConfig:
        """The settings that the run began with."""
        row = self._database.row("run")
        if row is None:
            raise never_began(self.directory)
        try:
            return self._database.decoded(_restored, row["config"])
        except ConfigError:
            version = row["version"]
            raise StoreError(
                f"{short_path(self.directory)} has settings unknown to this version of openeureka; "
                f"install version {version:.40} to open it."
            ) from None

    @property
    def ranks(self) -> Ranks:
        """By which F the search ranks candidates, as stored when it began."""
        row = self._database.row("run")
        plays = row is not None and row["ranks"] == "played" and self.config.search != "eureka"
        return "played" if plays else "training"

    # --- generations -------------------------------------------------------------------------------------------------

    def save_generation(self, generation: Generation) -> None:
        rows = [
            {
                "generation": generation.index,
                "slot": entry.sample.slot,
                "candidate": entry.sample.candidate.id if entry.sample.candidate is not None else None,
                "verdict": encode(entry.sample.verdict),
                "lane": entry.result.lane if entry.result is not None else None,
                "attempts": entry.sample.attempts,
                "feedback": safe_text(entry.feedback),
            }
            for entry in generation.entries
        ]
        self._database.put("entries", *rows)

    def history(self, results: Mapping[str, TrainingResult] | None = None) -> History:
        """Every finished generation; `results` are those of the run, where the caller has read them already."""
        results = self.lanes.results() if results is None else results
        limits = self.config.cost_limits
        plays = self.lanes.plays() if self.ranks == "played" else {}  # `tune=` plays lanes whatever the search ranks by
        scores = {lane: played(own, limits) for lane, own in plays.items()}
        generations: dict[int, list[Scored]] = {}
        for row in self._database.rows("entries", order=("generation", "slot")):
            generations.setdefault(row["generation"], []).append(self._scored(row, results, scores))
        if list(generations) != list(range(len(generations))):
            raise changed_row(self.directory, "a generation is missing")
        finished = [
            Generation(index, tuple(own), self.remarks.heard(index) or (), limits) for index, own in generations.items()
        ]
        return History(tuple(finished), "votes" if self.config.judge == "votes" else "fitness", limits)

    def _scored(self, row: Row, results: Mapping[str, TrainingResult], scores: Mapping[str, Evaluation]) -> Scored:
        sample = Sample(
            generation=row["generation"],
            slot=row["slot"],
            candidate=self.rewards.candidate(row["candidate"]),
            verdict=self._database.decoded(decode_verdict, row["verdict"]),
            attempts=row["attempts"],
        )
        result = self._database.decoded(results.__getitem__, row["lane"]) if row["lane"] is not None else None
        score = scores.get(result.lane) if result is not None else None
        return Scored(sample=sample, result=result, feedback=row["feedback"], played=score)

    def glance(self) -> Glance:
        """How far the run has come."""
        row = self._database.glance()
        return Glance(
            generations=row["generations"],
            fitness=self._lawful() if self.config.cost_limits else row["fitness"],
            evaluations=row["evaluations"],
            ended=bool(row["ended"]),
            trainings=row["trainings"],
            held_out=row["held_out"],
            human=row["human"],
            usage=decode_usage(row),
            word=self._database.decoded(convert, Word, row["word"] or ""),
        )

    def _lawful(self) -> float | None:
        """The best F of a policy that keeps the limits, of the lanes that may lead the run."""
        finished, limits = self._database.finished(), self.config.cost_limits
        scores = [played(own, limits) for lane, own in self.lanes.plays().items() if lane in finished]
        return max((s.fitness for s in scores if s.fitness is not None and not s.broken(limits)), default=None)

    # --- the best ----------------------------------------------------------------------------------------------------

    def save_crown(self, place: Place) -> None:
        """Store which candidate won the race."""
        self._database.put("crown", {"id": 1, **encode_place(place)})

    def crown(self) -> Place | None:
        """The candidate that won the race; None before the race is done, and in runs that had none."""
        row = self._database.row("crown")
        return decode_place(row) if row is not None else None

    def save_best(self, program: Candidate | None, policy: PolicyId) -> None:
        """Fill `best/` with the best reward and its policy, anew whenever a better reward comes.

        A reward that comes with the task has no program of its own.
        """
        if program is not None:
            artifacts.write(self.directory, "best/reward.py", program.source)
        else:
            artifacts.remove(self.directory, "best/reward.py")
        self.folders.fill("best", policy)

    def best(self) -> PolicyId | None:
        """The policy in `best/`; None before there is one. Where lanes left equal policies, a lane of the reward in
        `best/reward.py` is preferred."""
        source = artifacts.read(self.directory, "best/reward.py")
        own = Candidate.of(source.decode(errors="replace")).id if source is not None else None
        lanes, given, judged = self.lanes.all(), self.rewards.named(), self.lanes.evaluations()

        def fits(policy: PolicyId) -> tuple[bool, bool, bool]:
            lane = lanes[policy.lane]
            return lane.role != "robust", given.get(lane.reward, lane.reward) == own, policy.lane in judged

        return max(self.folders.held("best"), key=fits, default=None)

    @property
    def ended(self) -> bool:
        """Whether the search is done and only reports are left to write."""
        return self._database.row("ended") is not None

    def end(self, word: Word = "") -> None:
        """Mark the search as done but for reports, with the `word` of its verdict. A second call changes nothing."""
        if not self.ended:
            self._database.put("ended", {"id": 1, "word": word})

    # --- robust ------------------------------------------------------------------------------------------------------

    def save_robust(self, ranges: str, policy: PolicyId) -> None:
        """Fill `robust/` with a policy and the ranges that it trained with, as YAML."""
        self.folders.fill("robust", policy)
        artifacts.write(self.directory, "robust/ranges.yaml", ranges)

    def save_hardening(self, hardening: Hardening) -> None:
        """Store how `eureka robust` trains its policies. Only the first call counts."""
        if self.hardening() is None:
            artifacts.write(self.directory, HARDENING, encode(hardening))

    def hardening(self) -> Hardening | None:
        """What `save_hardening` stored; None before that."""
        text = artifacts.read(self.directory, HARDENING)
        return self._database.decoded(decode, Hardening, text) if text is not None else None


def _restored(text: str) -> RunConfig:
    return restored(RunConfig, decode(dict[str, object], text))


def _missing(directory: Path) -> str:
    """Why a directory is no run, and what to name instead where that is plain."""
    if not directory.exists():
        return f"there is no such directory; {NAME_IT}"
    if not directory.is_dir():
        return f"it is a file; {NAME_IT}"
    below = sorted(glob(f"*/{FILENAME}", root_dir=directory))
    if below:
        return f"it holds runs; name one, such as {(directory / below[-1]).parent}"
    return f"it has no {FILENAME}; {NAME_IT}"
