"""Names of new runs, and what is left where none begins."""

import subprocess
import sys

import pytest

from openeureka.store.directory import output_directory, swept

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
    names = [name for process in both for name in process.communicate(timeout=60)[0].split()]
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
