"""Every script of `benchmarks/` still finds what it imports."""

import importlib
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("name", sorted(file.stem for file in SCRIPTS.glob("*.py")))
def test_a_script_can_be_imported(name: str) -> None:
    importlib.import_module(name)
