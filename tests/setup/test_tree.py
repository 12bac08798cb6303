"""What a fresh clone relies on: pins that hold for any index, and a tree that names no machine."""

import ast
import re
import runpy
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
check_tree = runpy.run_path(str(ROOT / "scripts" / "check_tree.py"))

PINS = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]

TRACKERS = {"wandb", "mlflow"}
"""Extras that the environment of the tests lacks. Their tests use fakes."""


def test_every_pin_is_an_exact_public_version():
    assert [pin for pin in PINS if not re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][0-9a-z.]*", pin)] == []


def test_every_direct_dependency_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [found for name, found in project["optional-dependencies"].items() if name not in TRACKERS]
    wanted = [*project["dependencies"], *(d for extra in extras for d in extra if not d.startswith("openeureka["))]
    pinned = {_normal(pin.split("==")[0]) for pin in PINS}
    assert {_normal(re.split(r"[<>=!~;\[ ]", requirement)[0]) for requirement in wanted} <= pinned


@pytest.mark.parametrize(
    ("python", "machine", "has_wheels"),
    [("3.11", "x86_64", True), ("3.13", "x86_64", True), ("3.14", "x86_64", False), ("3.11", "aarch64", False)],
)
def test_box2d_is_asked_for_only_where_pip_need_not_build_it(python, machine, has_wheels):
    """A build needs a compiler, and without one no other package of the extra would be installed either."""
    extra = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["gym"]
    here = {"python_version": python, "platform_machine": machine}
    wanted = [r for r in map(Requirement, extra) if r.marker is None or r.marker.evaluate(here)]
    extras = {name for requirement in wanted for name in requirement.extras}
    assert extras == ({"classic-control", "box2d"} if has_wheels else {"classic-control"})


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("data = '/" + "home/somebody/data'", 1),
        ("pip install --index-" + "url x", 1),
        ("see https://example.org/" + "simple there", 1),
        ("outputs/home/x and ~/work/y", 0),
        ("import os", 0),
    ],
)
def test_the_tree_check_names_machine_paths_and_indexes(line, count, tmp_path):
    path = tmp_path / "file.py"
    path.write_text("first\n" + line)
    found = check_tree["findings"](path)
    assert len(found) == count
    assert all(text.startswith(f"{path}:2: ") for text in found)


def test_the_tree_check_names_large_files(tmp_path):
    path = tmp_path / "weights.bin"
    path.write_bytes(bytes(500_001))
    assert check_tree["findings"](path) == [f"{path}: 500001 bytes, more than 500000"]


STARTS = re.compile(
    r"Worker|Popen|(subprocess|os|multiprocessing)\.(Popen|run|call|check_\w+|fork|posix_spawn|system|popen|Process)"
)
"""Names of calls that start a process."""


def test_processes_are_started_where_contributing_says():
    package = ROOT / "src" / "openeureka"
    found = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and STARTS.fullmatch(ast.unparse(node.func))
    }
    assert found == {
        "worker.py",
        "adapters/foreign/server.py",
        "executors/transport.py",
        "sandbox/client.py",
        "sandbox/server.py",
        "llm/local.py",
        "llm/weights.py",
        "film/mp4.py",
        "film/video.py",
        "ui/actions.py",
        "ui/play.py",
    }
