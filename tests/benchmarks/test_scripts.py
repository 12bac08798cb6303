"""Scripts of `benchmarks/` find what they import, and say what is wrong with a directory."""

import importlib
import runpy
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("name", sorted(file.stem for file in SCRIPTS.glob("*.py")))
def test_a_script_can_be_imported(name: str) -> None:
    importlib.import_module(name)


@pytest.mark.parametrize("name", ["generations", "noise", "predictors"])
def test_a_directory_that_is_not_a_run_is_told_in_a_sentence(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", [name, str(tmp_path / "missing")])
    with pytest.raises(SystemExit, match="is not a run: there is no such directory"):
        runpy.run_path(str(SCRIPTS / f"{name}.py"), run_name="__main__")
