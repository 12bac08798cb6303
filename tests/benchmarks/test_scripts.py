"""Every script of `benchmarks/` still finds what it imports."""

import importlib
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("name", sorted(file.stem for file in SCRIPTS.glob("*.py")))
def test_a_script_can_be_imported(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS))
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name == "rsl_rl":  # what `parity.py` compares with is no dependency
            pytest.skip(str(error))
        raise
