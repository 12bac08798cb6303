"""`eureka train`: given rewards side by side, in a run that searches for nothing."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path

from ..config import RunConfig, TrainConfig, parse
from ..errors import WorkerError
from ..given import Given
from ..report import tables
from ..report.text import columns
from ..report.verdict import verdict
from ..report.view import RunView
from ..runs import compose, trust
from ..runs.rewards import named
from ..store.directory import output_directory
from ..tasks.registry import get
from ..text import plain
from ..types import TrainingState
from .show import facts
from .terminal import Terminal


def train(words: Sequence[str], *, as_json: bool = False) -> None:
    """Train every reward with every seed, or go on with that where `dir=` holds it; print a table, leave a report.

    As JSON: what `eureka show --json` prints, and the directory; what people are told goes to stderr.
    """
    typed = parse(TrainConfig, words)
    get(typed.env)
    trust.remember(typed)
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        rewards = named(typed)
        directory = output_directory(typed.dir, typed.env, "train_")
        run = compare(typed.run(), directory, rewards)
    if as_json:
        print(json.dumps({"directory": str(directory), **facts(run)}, indent=2))
    _say_what_failed(run)


def resume(config: RunConfig, directory: Path) -> None:
    """Go on with a run of given rewards; it holds them itself."""
    _say_what_failed(compare(config, directory, None))


def compare(config: RunConfig, directory: Path, rewards: Given | None) -> RunView:
    """Train what is missing, write the report and print the scores.

    Args:
        rewards: None for those that the run holds.
    """
    problems = compose.train(config, directory, rewards, Terminal())
    run = RunView.read(directory)
    scores = tables.given(run)
    print(f"\n{columns([scores.titles, *scores.rows])}\n\n{scores.note}\n{plain(verdict(run))}")
    for lane, result in run.results.items():
        if result.state is TrainingState.DIVERGED:
            print(plain(f"{lane} {result.message}"))
    for problem in problems:
        print(plain(problem))
    print(f"\nEverything is in {directory}; begin with report.html")
    return run


def _say_what_failed(run: RunView) -> None:
    failed = {lane: result.message for lane, result in run.results.items() if result.state is TrainingState.FAILED}
    if not failed:
        return
    reason = next(iter(failed.values()))
    if len(failed) == len(run.results):
        raise WorkerError(reason)
    raise WorkerError(f"{', '.join(failed)} could not be trained. {reason}")
