"""Run directories from outside: a name for a new one, what one holds, whether it is at work, a word to it, its end."""

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
from .store import Store, expect_same

OUTPUTS = Path("outputs")
"""Where they go."""
_NEW = set[Path]()
"""Those that were made for a run to begin in."""


def output_directory(chosen: str, env: str, kind: str = "", root: Path = OUTPUTS) -> Path:
    """The chosen directory, or a new one, `<root>/<time>_<kind><env>`, which no other process gets: as a whole path, as
    a program may leave its working directory while the run goes on.

    The new one is made, as that takes the name. Where no run begins in it, `swept` removes it.

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
    """Leave nothing of a directory that was made for a run which did not begin, as where a setting was refused."""
    try:
        yield
    finally:
        if directory in _NEW:
            _NEW.remove(directory)
            with suppress(OSError):  # as where it holds the run
                directory.rmdir()
                directory.parent.rmdir()


# --- what one holds --------------------------------------------------------------------------------------------------


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

    A replaying run that is itself resumed skips as many as its own store already holds.
    """
    with Store.view(directory) as store:
        return store.talk.replies()


def read_remarks(directory: Path | str) -> dict[int, tuple[Remark, ...]]:
    """What a person said of a run, by the generation after which it was heard, for `model=replay:DIR`."""
    with Store.view(directory) as store:
        return {generation.index: generation.remarks for generation in store.history().generations}


def expect_files(store: Store) -> None:
    """Refuse a run of which the rows alone are here: what its trainings left lies in files beside them. Raises
    StoreError."""
    lanes = store.lanes.results()
    if lanes and not any(artifacts.exists(store.directory, f"lanes/{lane}/curves.json") for lane in lanes):
        raise StoreError(
            f"{store.directory} holds the rows of a run alone, without its best/ and lanes/: copy the whole folder, or "
            "search again."
        )


def is_run(directory: Path | str) -> bool:
    """Whether the directory has the file of a run, begun or not; not where nobody may look."""
    return os.path.isfile(Path(directory) / FILENAME)


def has_begun(directory: Path | str) -> bool:
    """Whether there is a run to go on with: its settings are kept. Raises StoreError when they cannot be read."""
    try:
        read_config(directory)
    except NotBegun:
        return False
    return True


def expect_free(directory: Path, config: RunConfig) -> None:
    """Refuse what `Store.open` would, before anything is tried or told. Raises StoreError."""
    artifacts.expect_room(directory)
    if is_held(directory):
        raise at_work(directory)
    if has_begun(directory):
        expect_same(directory, read_config(directory), config)


# --- a word to one that is at work -----------------------------------------------------------------------------------


def say(directory: Path | str, *remarks: Remark) -> None:
    """Commit remarks, all or none, for the next generation that the run asks for.

    Raises:
        FeedbackError: when the run waits for no person, repeats what was said in another, is over, or has no such
            trained candidate, or only a rejected one as the favourite; for `go` before there is something to judge.
        StoreError: when there is no run.
    """
    with Store.view(directory) as store:
        if store.config.model.startswith("replay:"):
            raise FeedbackError(
                f"The run in {store.directory} repeats what was said in another; for words of yours, start one with "
                "another model=."
            )
        check(store, remarks)
        _expect_standing(store, remarks)
        if not awaits_go(store) and any(remark.kind is RemarkKind.GO for remark in remarks):
            raise FeedbackError(
                f"The run in {store.directory} has no new policies to judge yet, so nothing was kept; leave out `go`, "
                "or say it when they are trained."
            )
    with Store.visit(directory) as store:
        store.remarks.say(*remarks)


def awaits_go(store: Store) -> bool:
    """Whether the last trained generation is one to judge that nothing was made of yet. A `go` said earlier would end
    the wait for one that nobody has watched."""
    trained = store.glance().generations
    return 0 < trained <= store.config.hearings and store.remarks.heard(trained - 1) is None


def check(store: Store, remarks: Iterable[Remark]) -> None:
    """Refuse what the run would not hear or could not follow. Raises FeedbackError."""
    config = store.config
    if config.feedback != "human":
        raise FeedbackError(f"The run in {store.directory} does not wait for a person; start one with feedback=human.")
    if store.remarks.heard(config.hearings - 1) is not None:
        raise FeedbackError(f"The run in {store.directory} has asked for its last generation; nothing more is heard.")
    trained = {entry.sample.place for entry in store.history().entries if entry.result is not None}
    for remark in remarks:
        for place in (remark.place, remark.over):
            if place is not None and place not in trained:
                raise FeedbackError(f"{place} is no trained candidate of a finished generation; {_known(trained)}.")


def _expect_standing(store: Store, remarks: Sequence[Remark]) -> None:
    """Refuse a favourite whose program was vetoed: it would be kept, and never be a parent. Raises FeedbackError."""
    programs: dict[Place | None, CandidateId] = {
        entry.sample.place: entry.candidate_id for entry in store.history().entries
    }
    said = (*store.remarks.all(), *remarks)
    vetoed = {programs.get(remark.place) for remark in said if remark.kind is RemarkKind.VETO}
    for remark in remarks:
        if remark.kind is RemarkKind.FAVOURITE and programs.get(remark.place) in vetoed:
            raise FeedbackError(f"{remark.place} was vetoed, which holds for good; choose another favourite.")


def _known(trained: set[Place]) -> str:
    return f"there are {', '.join(map(str, sorted(trained)))}" if trained else "there is none yet"


# --- its end: asked for by a file, which also reaches a process on another machine -----------------------------------


def ask_to_stop(directory: Path | str) -> None:
    """Ask the process that works on a run to stop as by Ctrl-C; it hears of it within a second.

    Raises:
        StoreError: when there is no run, or nobody works on it.
    """
    directory = Path(directory)
    if not is_run(directory):
        raise StoreError(f"{short_path(directory)} is not a run; name the directory that `eureka run` printed.")
    if not is_held(directory):
        raise StoreError(f"Nobody works on {short_path(directory)}, so there is nothing to stop.")
    with explained(directory):
        artifacts.appended(directory, STOP).close()


def is_asked_to_stop(directory: Path) -> bool:
    return artifacts.exists(directory, STOP)


def withdraw(directory: Path) -> None:
    """Forget a request: it was followed, or came when nobody worked on the run any more."""
    with explained(directory):
        (directory / STOP).unlink(missing_ok=True)
