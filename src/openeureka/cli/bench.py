"""`eureka bench`: the terminal as the host of one search after the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..benchmark.bench import PAGE, Bench, opened, run
from ..parsing import parse
from ..report.text import columns
from ..text import plain
from .settings import BenchConfig, only_path, split
from .terminal import Terminal


class _Host(Terminal):
    """One whose searches go on with the bench."""

    def __init__(self, command: str) -> None:
        self._command = command

    def again(self, directory: Path) -> str:
        return self._command


def bench(words: Sequence[str]) -> int:
    """Run the cells of a plan that are missing and print the comparison.

    Returns:
        The exit status: that of the first cell that could not be finished, 0 where all are.
    """
    settings, paths = split(words)
    path = only_path(paths, "eureka bench plan.yaml dir=outputs/ablations")
    plan, directory = opened(path, parse(BenchConfig, settings).dir)
    told: list[Bench] = []
    host = _Host(" ".join(["eureka bench", str(path), *settings]))
    run(plan, directory, host, tell=told.append, say=lambda text: print(plain(text), flush=True))
    _tell(told[-1])
    return next((error.exit_code for error in told[-1].failures.values()), 0)


def _tell(found: Bench) -> None:
    for table in found.compared.tables():
        print(plain(f"\n{columns([table.titles, *table.rows])}\n\n{table.note}"))
    for name, error in found.failures.items():
        print(plain(f"{name} could not be finished: {error}"))
    print(f"\nEverything is in {found.directory}; begin with {PAGE}")
