"""Run directories from outside: to name a new one, read what one holds, say something to a run at work, and stop it."""

from __future__ import annotations

import os
import time
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..config import RunConfig, short_name
from ..errors import FeedbackError, NotBegun, StoreError
from ..parsing import short_path, whole_path
from ..types import CandidateId, Glance, Place, Remark, RemarkKind, Reply
from . import artifacts, summary
from .db import FILENAME, STOP, at_work, explained
from .hold import is_held
from .store import NAME_IT, Store, expect_same

OUTPUTS = Path("outputs")
"""The folder of new run directories."""
_NEW = set[Path]()
"""Directories that `output_directory` has made, until `swept` is left."""


def output_directory(chosen: str, env: str, kind: str = "", root: Path = OUTPUTS) -> Path:
    """The chosen directory, or a new one, `<root>/<time>_<kind><env>`, which no other process gets.

    The path is absolute, because a program may change its working directory while the run goes on. A new directory is
    made at once, to reserve its name. Where no run begins in it, `swept` removes it.

    Raises:
        StoreError: when it cannot be made.
    """
    if chosen:
        return whole_path(chosen)
    root = whole_path(root)
    path = first = root / f"{time.strftime('%Y-%m-%d_%H-%M-%S')}_{kind}{short_name(env)}"
    number = 1
    with explained(root):
        root.mkdir(parents=True, exist_ok=True)
        while True:
            try:
                path.mkdir()
            except FileExistsError:
                number += 1
                path = first.with_name(f"{first.name}~{number}")
            else:
                _NEW.add(path)
                return path


@contextmanager
def swept(directory: Path) -> Generator[None]:
    """Afterwards remove a new directory in which no run began, as where a setting was refused."""
    try:
        yield
    finally:
        if directory in _NEW:
            _NEW.remove(directory)
            with suppress(OSError):  # not empty: the run began
                directory.rmdir()
                directory.parent.rmdir()


# --- what a directory holds ------------------------------------------------------------------------------------------


def read_config(directory: Path | str) -> RunConfig:
    """The settings a run began with. Raises StoreError when there is no run."""
    with Store.view(directory) as store:
        return store.config


def look(directory: Path | str) -> tuple[RunConfig, Glance]:
    """The settings of a run and how far it has come, also while it goes on. Raises StoreError when there is none."""
    kept = summary.read(Path(directory))
    if kept is not None:
        return kept
    with Store.view(directory) as store:
        return store.config, store.glance()


def read_replies(directory: Path | str) -> tuple[Reply, ...]:
    """Every reply of a run in the order in which the same search asks for them, for `model=replay:DIR`.

    A replaying run that is itself resumed skips as many replies as its own store already holds.
    """
    with Store.view(directory) as store:
        return store.talk.replies()


def read_remarks(directory: Path | str) -> dict[int, tuple[Remark, ...]]:
    """The remarks on a run, by the generation after which they were heard, for `model=replay:DIR`."""
    with Store.view(directory) as store:
        return {generation.index: generation.remarks for generation in store.history().generations}


def expect_files(store: Store) -> None:
    """Refuse a directory that holds only the rows of a run, without the files that its trainings left. Raises
    StoreError."""
    lanes = store.lanes.results()
    if lanes and not any(artifacts.exists(store.directory, f"lanes/{lane}/curves.json") for lane in lanes):
        raise StoreError(
            f"{store.directory} holds only the rows of a run, without its best/ and lanes/. Copy the whole folder, or "
            "search again."
        )


def is_run(directory: Path | str) -> bool:
    """Whether the directory has the file of a run, begun or not; False where it may not be read."""
    return os.path.isfile(Path(directory) / FILENAME)


def has_begun(directory: Path | str) -> bool:
    """Whether there is a run to continue: its settings are stored. Raises StoreError when they cannot be read."""
    try:
        read_config(directory)
    except NotBegun:
        return False
    return True


def expect_free(directory: Path, config: RunConfig) -> None:
    """Refuse what `Store.open` would refuse, before anything is tried or told. Raises StoreError."""
    artifacts.expect_room(directory)
    if is_held(directory):
        raise at_work(directory)
    if has_begun(directory):
        expect_same(directory, read_config(directory), config)


# --- remarks to a run at work ----------------------------------------------------------------------------------------


def say(directory: Path | str, *remarks: Remark) -> None:
    """Commit remarks, all or none, for the next generation that the run asks for.

    Raises:
        FeedbackError: when the run waits for no person, replays another run, or has asked for its last generation; for
            a candidate that did not train, a favourite that was vetoed, and `go` before there are policies to judge.
        StoreError: when there is no run.
    """
    with Store.view(directory) as store:
        if store.config.model.startswith("replay:"):
            raise FeedbackError(
                f"The run in {store.directory} replays the feedback of another run. To give feedback of your own, "
                "start a run with another model=."
            )
        check(store, remarks)
        _expect_standing(store, remarks)
        if not awaits_go(store) and any(remark.kind is RemarkKind.GO for remark in remarks):
            raise FeedbackError(
                f"The run in {store.directory} has no new policies to judge yet, so nothing was saved; leave `go` out, "
                "or say it when they are trained."
            )
    with Store.visit(directory) as store:
        store.remarks.say(*remarks)


def awaits_go(store: Store) -> bool:
    """Whether the last trained generation is still to be judged. A `go` that is said earlier would end the wait for a
    generation that nobody has watched."""
    trained = store.glance().generations
    return 0 < trained <= store.config.hearings and store.remarks.heard(trained - 1) is None


def check(store: Store, remarks: Iterable[Remark]) -> None:
    """Refuse remarks that the run would not hear or could not follow. Raises FeedbackError."""
    config = store.config
    if config.feedback != "human":
        raise FeedbackError(f"The run in {store.directory} does not wait for a person; start one with feedback=human.")
    if store.remarks.heard(config.hearings - 1) is not None:
        raise FeedbackError(f"The run in {store.directory} has asked for its last generation; it hears no more.")
    trained = {entry.sample.place for entry in store.history().entries if entry.result is not None}
    for remark in remarks:
        for place in (remark.place, remark.over):
            if place is not None and place not in trained:
                raise FeedbackError(f"{place} is not a trained candidate of a finished generation; {_known(trained)}.")


def _expect_standing(store: Store, remarks: Sequence[Remark]) -> None:
    """Refuse a favourite whose program was vetoed: it would never become a parent. Raises FeedbackError."""
    programs: dict[Place | None, CandidateId] = {
        entry.sample.place: entry.candidate_id for entry in store.history().entries
    }
    said = (*store.remarks.all(), *remarks)
    vetoed = {programs.get(remark.place) for remark in said if remark.kind is RemarkKind.VETO}
    for remark in remarks:
        if remark.kind is RemarkKind.FAVOURITE and programs.get(remark.place) in vetoed:
            raise FeedbackError(f"{remark.place} was vetoed, which cannot be undone; choose another favourite.")


def _known(trained: set[Place]) -> str:
    return f"there are {', '.join(map(str, sorted(trained)))}" if trained else "there is none yet"


# --- requests to stop, by a file, which also reaches a process on another machine ------------------------------------


def ask_to_stop(directory: Path | str) -> None:
    """Ask the process that works on a run to stop as by Ctrl-C; it notices within a second.

    Raises:
        StoreError: when there is no run, or nobody works on it.
    """
    directory = Path(directory)
    if not is_run(directory):
        raise StoreError(f"{short_path(directory)} is not a run; {NAME_IT}.")
    if not is_held(directory):
        raise StoreError(f"{short_path(directory)} is not running, so there is nothing to stop.")
    with explained(directory):
        artifacts.appended(directory, STOP).close()


def is_asked_to_stop(directory: Path) -> bool:
    return artifacts.exists(directory, STOP)


def withdraw(directory: Path) -> None:
    """Delete a request to stop: it was followed, or came when no process worked on the run any more."""
    with explained(directory):
        (directory / STOP).unlink(missing_ok=True)
