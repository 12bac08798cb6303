"""Names of new runs, what a run that does not begin leaves, and which machine is running one."""

import errno
import fcntl
import os
import subprocess
import sys

import pytest

from openeureka.config import RunConfig
from openeureka.errors import StoreError
from openeureka.store import Store, hold, is_held
from openeureka.store.db import LOCK
from openeureka.store.directory import ask_to_stop, is_asked_to_stop, output_directory, swept

_NAMES = """
import sys
from pathlib import Path
from openeureka.store import directory

directory.time.strftime = lambda _: "now"
print(*(directory.output_directory("", "cartpole", root=Path(sys.argv[1])).name for _ in range(20)))
"""


def test_runs_that_begin_in_one_second_get_names_of_their_own(tmp_path):
    command = [sys.executable, "-c", _NAMES, str(tmp_path / "outputs")]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    names = [name for process in both for name in process.communicate()[0].split()]
    assert len(set(names)) == 40 and all(name.partition("~")[0] == "now_cartpole" for name in names)


def test_a_run_that_does_not_begin_leaves_nothing(tmp_path):
    with pytest.raises(RuntimeError), swept(output_directory("", "cartpole", root=tmp_path / "outputs")):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_what_a_run_began_with_stays_and_so_does_an_empty_directory_of_a_person(tmp_path):
    begun = output_directory("", "cartpole", root=tmp_path / "outputs")
    (tmp_path / "mine").mkdir()
    with swept(begun), swept(output_directory(str(tmp_path / "mine"), "cartpole")):
        (begun / "run.sqlite").touch()
    assert begun.is_dir() and (tmp_path / "mine").is_dir()


def test_rows_of_a_run_at_work_on_another_machine_are_not_opened_here(tmp_path):
    """Machines may share a file system, but SQLite keeps its log's index in memory, which only one machine has."""
    with Store.open(tmp_path / "run", RunConfig(env="toy")):
        boot, host = (tmp_path / "run" / LOCK).read_text().split()
        assert host == os.uname().nodename and len(boot) == 36
        (tmp_path / "run" / LOCK).write_text("73b1c2a0-0000-4000-8000-000000000000 node\x1b7.example.org\n")
        for look in (Store.view, Store.visit):
            with pytest.raises(StoreError, match=r"run is running on node7?.{0,9}example\.org, and until it stops"):
                look(tmp_path / "run")
        ask_to_stop(tmp_path / "run")  # needs no rows
        assert is_asked_to_stop(tmp_path / "run")
        (tmp_path / "run" / LOCK).write_text(f"{boot} a-container\n")  # this machine's boot id, another host name
        Store.view(tmp_path / "run").close()
        (tmp_path / "run" / LOCK).write_bytes(b"73b1\xff node\xff7\n")
        with pytest.raises(StoreError, match="is running on node"):
            Store.view(tmp_path / "run")
        (tmp_path / "run" / LOCK).write_text("")  # as an older version leaves it
        Store.view(tmp_path / "run").close()
    (tmp_path / "run" / LOCK).write_text("73b1c2a0-0000-4000-8000-000000000000 node7.example.org\n")
    Store.view(tmp_path / "run").close()  # the process on the other machine was killed
    Store.open(tmp_path / "run", RunConfig(env="toy")).close()
    assert (tmp_path / "run" / LOCK).read_text().split() == [boot, host]


def test_a_run_at_work_is_read_where_the_kernel_does_not_say_which_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(hold, "_BOOT", tmp_path / "hidden")
    with Store.open(tmp_path / "run", RunConfig(env="toy")):
        assert (tmp_path / "run" / LOCK).read_text() == f" {os.uname().nodename}\n"
        Store.view(tmp_path / "run").close()
        (tmp_path / "run" / LOCK).write_text("73b1c2a0-0000-4000-8000-000000000000 a-container\n")
        Store.view(tmp_path / "run").close()  # of two containers on a machine, only one may hide it


def test_a_run_that_is_stopped_while_it_begins_holds_no_lock(tmp_path, monkeypatch):
    def stopped():
        raise KeyboardInterrupt

    monkeypatch.setattr(hold, "_boot", stopped)
    with pytest.raises(KeyboardInterrupt) as kept:  # somebody may keep the error, and what is local where it was raised
        Store.open(tmp_path / "run", RunConfig(env="toy"))
    assert kept.tb is not None and not is_held(tmp_path / "run")


def test_no_run_begins_where_the_file_system_has_no_locks(tmp_path, monkeypatch):
    def missing(*_):
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(fcntl, "flock", missing)
    with pytest.raises(
        StoreError, match=r"The file system of .*run has no file locks, which a run needs; choose another folder"
    ):
        Store.open(tmp_path / "run", RunConfig(env="toy"))
    monkeypatch.undo()
    Store.open(tmp_path / "run", RunConfig(env="toy")).close()
    monkeypatch.setattr(fcntl, "flock", missing)
    assert not is_held(tmp_path / "run")
    Store.view(tmp_path / "run").close()
