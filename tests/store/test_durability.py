"""What can happen to a run directory: a full disk, damage, copies, other programs, missing rights, a clock that jumps.

`docs/concepts/store.md` has a table of the outcomes. Each refusal is one sentence for the person.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import stat
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from loop.alone import run

from openeureka import strategies
from openeureka.config import RunConfig
from openeureka.errors import StoreError
from openeureka.store import Store, db, read_config, say
from openeureka.store.directory import expect_free
from openeureka.store.schema import MIGRATIONS, OLDEST
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import Remark, RemarkKind

CONFIG = RunConfig(env="toy", sample=2, iteration=2, seeds=1)
SCRIPT = [reply(1), reply(2), reply(4), reply(3)]


def search_in(directory: Path) -> int:
    """Begin or continue a scripted search. Returns how many replies it asked for."""
    with Store.open(directory, CONFIG) as store:
        model = ScriptedModel(SCRIPT, said=len(store.talk.replies()))
        before = model.said
        run(CONFIG, store, model, ToyChecker(), ToyTrainer(), TOY, strategies.make(CONFIG))
        return model.said - before


@pytest.fixture
def finished(tmp_path: Path) -> Path:
    search_in(tmp_path / "run")
    return tmp_path / "run"


def refusal(act: Callable[[], object]) -> str:
    """The one-line sentence with which `act` is refused."""
    with pytest.raises(StoreError) as caught:
        act()
    assert "\n" not in str(caught.value)
    return str(caught.value)


# --- the disk --------------------------------------------------------------------------------------------------------


@pytest.fixture
def small_disk() -> Iterator[Callable[[str], Path]]:
    """A function that mounts a disk of the given size, or resizes the one that is mounted."""
    if os.geteuid() != 0:
        pytest.skip("only root can mount")
    with tempfile.TemporaryDirectory() as place:

        def sized(size: str) -> Path:
            options = f"size={size}" + (",remount" if os.path.ismount(place) else "")
            made = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", place], capture_output=True)
            if made.returncode:
                pytest.skip("this container may not mount")
            return Path(place)

        yield sized
        subprocess.run(["umount", "--lazy", place], check=False)


@pytest.mark.parametrize("size", ["64k", "112k", "160k", "208k"])
def test_a_full_disk_is_said_and_the_search_goes_on_when_there_is_room(small_disk: Callable[[str], Path], size: str):
    directory = small_disk(size) / "run"
    assert "is full; free some space" in refusal(lambda: search_in(directory))
    small_disk("4m")
    search_in(directory)
    with closing(sqlite3.connect(directory / db.FILENAME)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    with Store.view(directory) as store:
        assert [score.fitness for score in store.history().generations[1].entries] == [4.0, 3.0]
        assert len(store.talk.replies()) == len(SCRIPT)


# --- damage ----------------------------------------------------------------------------------------------------------


def cut(path: Path, size: int) -> None:
    with path.open("r+b") as file:
        file.truncate(size)


def test_a_database_cut_in_half_is_named(finished: Path):
    path = finished / db.FILENAME
    cut(path, path.stat().st_size // 2)
    assert "run.sqlite is damaged" in refusal(lambda: Store.open(finished, CONFIG))


def test_a_page_of_zeros_is_found_before_anything_is_written(finished: Path):
    path = finished / db.FILENAME
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.seek(4096)
        file.write(bytes(size - 2 * 4096))
    assert "run.sqlite is damaged" in refusal(lambda: Store.open(finished, CONFIG))


@pytest.mark.parametrize("lose", [lambda path: cut(path, 0), lambda path: path.unlink()])
def test_a_run_that_lost_its_database_does_not_begin_anew(finished: Path, lose: Callable[[Path], None]):
    lose(finished / db.FILENAME)
    sentence = refusal(lambda: search_in(finished))
    assert "choose another dir=" in sentence


def test_a_damaged_or_missing_policy_is_named_before_it_is_used(finished: Path):
    with Store.view(finished) as store:
        lane = next(iter(store.lanes.results()))
        path = finished / "lanes" / lane / "best_reward.safetensors"
        whole = path.read_bytes()
        assert store.lanes.policy(lane, "reward") == whole
        for content in (whole[:-1], b"", None):
            path.unlink()
            if content is not None:
                path.write_bytes(content)
            assert f"{path} is missing or damaged" in refusal(lambda: store.lanes.policy(lane, "reward"))
            path.write_bytes(whole)


def test_half_an_artefact_that_a_killed_writer_left_is_deleted(finished: Path):
    leftover = finished / "best" / ".reward.py.0123456789abcdef.tmp"
    leftover.write_text("def compute_rew")
    search_in(finished)
    assert not leftover.exists()
    assert "return 4" in (finished / "best" / "reward.py").read_text()


# --- copies ----------------------------------------------------------------------------------------------------------


def stopped(directory: Path) -> Path:
    """A run with its first generation done."""

    class Stopping(ScriptedModel):
        def sample(self, prompt, *, n, seed):
            if self.said == 2:
                raise KeyboardInterrupt
            yield from super().sample(prompt, n=n, seed=seed)

    with Store.open(directory, CONFIG) as store, pytest.raises(KeyboardInterrupt):
        run(CONFIG, store, Stopping(SCRIPT), ToyChecker(), ToyTrainer(), TOY, strategies.make(CONFIG))
    return directory


@pytest.mark.parametrize("take", [shutil.move, shutil.copytree])
def test_a_run_goes_on_where_it_was_moved_or_copied(tmp_path: Path, take: Callable[[Path, Path], object]):
    elsewhere = tmp_path / "other" / "place"
    elsewhere.parent.mkdir()
    take(stopped(tmp_path / "run"), elsewhere)
    assert search_in(elsewhere) == 2  # the first two replies were stored
    assert "return 4" in (elsewhere / "best" / "reward.py").read_text()


def test_a_copy_does_not_touch_the_run_it_is_of(tmp_path: Path):
    original = stopped(tmp_path / "run")
    shutil.copytree(original, tmp_path / "copy")
    search_in(tmp_path / "copy")
    with Store.view(original) as store:
        assert len(store.talk.replies()) == 2
    assert search_in(original) == 2


# --- other programs and users ----------------------------------------------------------------------------------------


def test_another_program_that_holds_the_database_is_named(finished: Path):
    other = sqlite3.connect(finished / db.FILENAME, isolation_level=None)
    with Store.open(finished, CONFIG) as store:
        store._database._connection.execute("PRAGMA busy_timeout = 10")
        other.execute("BEGIN IMMEDIATE")
        row = {"generation": 9, "slot": 0, "messages": "[]"}
        assert "Another program is writing to" in refusal(lambda: store._database.put("prompts", row))
        other.execute("ROLLBACK")
        store._database.put("prompts", row)
    other.close()


def as_nobody(act: Callable[[], object]) -> str:
    """The result of `act` as the user `nobody`, as text, or the sentence with which it is refused."""
    if os.geteuid() != 0:
        return _answer(act)
    os.setresgid(65534, 65534, 0)
    os.setresuid(65534, 65534, 0)  # the saved user id stays root, to change back
    try:
        return _answer(act)
    finally:
        os.setresuid(0, 0, 0)
        os.setresgid(0, 0, 0)


def _answer(act: Callable[[], object]) -> str:
    try:
        return str(act())
    except StoreError as error:
        return str(error)


@pytest.fixture
def foreign() -> Iterator[Path]:
    """A finished run that may be read but not written."""
    with tempfile.TemporaryDirectory() as place:
        search_in(Path(place) / "run")
        paths = [Path(place), *Path(place).rglob("*")]
        for path in paths:
            path.chmod(0o555 if path.is_dir() else 0o444)
        yield Path(place) / "run"
        for path in paths:
            if path.is_dir():
                path.chmod(stat.S_IRWXU)


def test_a_run_in_a_read_only_directory_can_be_read(foreign: Path):
    assert as_nobody(lambda: read_config(foreign).env) == "toy"
    assert not (foreign / f"{db.FILENAME}-wal").exists()


def test_the_last_rows_of_a_killed_run_need_a_place_to_be_read_in(foreign: Path):
    wal = foreign / f"{db.FILENAME}-wal"
    foreign.chmod(0o755)
    wal.write_bytes(b"rows")
    wal.chmod(0o444)
    foreign.chmod(0o555)
    assert f"Copy {foreign}, and open the copy" in as_nobody(lambda: read_config(foreign).env)


def test_a_run_in_a_read_only_directory_cannot_go_on(foreign: Path):
    assert "cannot be written; check its permissions" in as_nobody(lambda: Store.open(foreign, CONFIG))


def test_a_run_cannot_begin_in_a_directory_without_rights(foreign: Path):
    assert "cannot be written; check its permissions" in as_nobody(lambda: Store.open(foreign.parent / "new", CONFIG))


def test_what_may_not_be_written_is_refused_before_a_lock_is_taken(foreign: Path):
    for place in (foreign, foreign.parent / "new"):
        assert "cannot be written; check its permissions" in as_nobody(lambda place=place: expect_free(place, CONFIG))
    foreign.chmod(0o777)  # the folder is open to all, its rows are not
    assert "cannot be written; check its permissions" in as_nobody(lambda: expect_free(foreign, CONFIG))


def test_a_run_that_nobody_else_may_read_says_so(foreign: Path):
    (foreign / db.FILENAME).chmod(0)
    assert "cannot be read; check its permissions" in as_nobody(lambda: read_config(foreign))


def test_who_may_write_the_folder_but_not_the_run_leaves_no_index_that_would_end_it(foreign: Path):
    foreign.chmod(0o777)
    assert as_nobody(lambda: read_config(foreign).env) == "toy"
    assert "cannot be written" in as_nobody(lambda: Store.visit(foreign))
    assert not list(foreign.glob(f"{db.FILENAME}-*"))


def test_a_group_may_write_all_of_a_run_that_began_with_such_a_umask(tmp_path: Path):
    before = os.umask(0o002)
    try:
        search_in(tmp_path / "run")
    finally:
        os.umask(before)
    files = [path for path in (tmp_path / "run").rglob("*") if path.is_file()]
    assert {path.name: oct(path.stat().st_mode & 0o777) for path in files} == {path.name: "0o664" for path in files}


def test_a_run_of_an_older_version_can_be_read_and_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with monkeypatch.context() as older:
        older.setattr(db, "MIGRATIONS", {OLDEST: MIGRATIONS[OLDEST]})
        Store.open(tmp_path, CONFIG).close()
    before = (tmp_path / db.FILENAME).read_bytes()
    with Store.view(tmp_path) as store:
        assert store.config == CONFIG
        assert store.lanes.tryouts() == {} and store.ranks == "played"
    assert (tmp_path / db.FILENAME).read_bytes() == before


def test_a_word_to_a_run_of_an_older_version_leaves_its_process_the_tables_it_knows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    newest, asked = max(MIGRATIONS), replace(CONFIG, feedback="human")
    before = {n: script for n, script in MIGRATIONS.items() if n < newest}
    with monkeypatch.context() as older:
        older.setattr(db, "MIGRATIONS", before)
        with Store.open(tmp_path, asked) as running:
            older.undo()
            say(tmp_path, Remark(kind=RemarkKind.WORDS, text="calmer"))
            older.setattr(db, "MIGRATIONS", before)
            assert [remark.text for remark in running.remarks.unheard()] == ["calmer"]
            assert running._database._schema() == newest - 1
    with Store.open(tmp_path, asked) as store:
        assert store._database._schema() == newest


# --- the clock -------------------------------------------------------------------------------------------------------


def test_a_clock_that_jumps_changes_nothing(tmp_path: Path, finished: Path, monkeypatch: pytest.MonkeyPatch):
    hours = iter(range(10**6))
    monkeypatch.setattr(time, "time", lambda: 1e9 - 3600.0 * next(hours))
    search_in(tmp_path / "jumping")
    with Store.view(finished) as steady, Store.view(tmp_path / "jumping") as jumping:
        assert jumping.history() == steady.history()
        assert jumping.lanes.evaluations() == steady.lanes.evaluations()


def test_what_was_made_of_another_policy_goes_with_it_whatever_its_date(tmp_path: Path):
    directory = stopped(tmp_path / "run")
    film = directory / "best" / "video.mp4"
    film.write_bytes(b"of the first generation's policy")
    os.utime(film, (4e9, 4e9))  # newer than anything
    search_in(directory)
    assert not film.exists()
    film.write_bytes(b"of the final policy")
    search_in(directory)
    assert film.exists(), "a film of the same policy stays"
