"""Confinement needs no privileges: if the tests run as root, these run again as a user without any."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from openeureka.testing.hostile import CORPUS, Layer

TESTS = Path(__file__).parents[1]
NOBODY = 65534


@pytest.fixture
def workshop() -> Iterator[Path]:
    """A directory of the user `nobody`. pytest's own directories are closed to other users."""
    with tempfile.TemporaryDirectory() as name:
        os.chown(name, NOBODY, NOBODY)
        yield Path(name)


# `user=` of subprocess would copy this whole process, for which the memory may not suffice.
STEP_DOWN = f"""
import os, sys
os.setgroups([])
os.setgid({NOBODY})
os.setuid({NOBODY})
os.execv(sys.argv[1], sys.argv[1:])
"""


def as_nobody(*command: str, home: Path) -> subprocess.CompletedProcess[str]:
    environment = {"HOME": str(home), "TMPDIR": str(home), "PATH": os.environ["PATH"], "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-I", "-c", STEP_DOWN, *command], env=environment, cwd=home, capture_output=True, text=True
    )


def interpreter(workshop: Path) -> str | None:
    """A Python that the user `nobody` may run, with the packages of this one. None if there is none."""
    installed = shutil.which(f"python3.{sys.version_info.minor}", path="/usr/local/bin:/usr/bin")
    for base in {os.path.realpath(sys.executable), installed} - {None}:
        environment = workshop / f"environment-of-{base.replace('/', '-')}"
        packages = environment / "lib" / f"python3.{sys.version_info.minor}" / "site-packages"
        packages.mkdir(parents=True)
        (environment / "bin").mkdir()
        (environment / "bin" / "python").symlink_to(base)
        (environment / "pyvenv.cfg").write_text(f"home = {os.path.dirname(base)}\n")
        paths = [sysconfig.get_path("purelib"), str(TESTS.parent / "src"), str(TESTS)]
        (packages / "shared.pth").write_text("\n".join(paths))
        python = str(environment / "bin" / "python")
        if as_nobody(python, "-c", "import torch, pytest, openeureka", home=workshop).returncode == 0:
            return python
    return None


@pytest.mark.skipif(os.geteuid() != 0, reason="these tests run as an ordinary user already")
def test_the_hostile_corpus_does_no_harm_without_root(workshop: Path) -> None:
    python = interpreter(workshop)
    if python is None:
        pytest.skip("an ordinary user may not read this Python or these packages")
    corpus = str(TESTS / "sandbox" / "test_hostile.py")
    options = ["-p", "no:cacheprovider", f"--rootdir={TESTS.parent}", f"--basetemp={workshop / 'tests'}"]
    stopped = [hostile.id for hostile in CORPUS if hostile.layer is Layer.KERNEL]
    options += ["-k", " or ".join(["without_the_gate", "honest", *stopped])]  # no others depend on the user's rights
    done = as_nobody(python, "-m", "pytest", *options, corpus, home=workshop)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
