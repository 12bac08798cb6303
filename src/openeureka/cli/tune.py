"""`eureka tune`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path

from ..config import RunConfig, TuneConfig, parse
from ..report.view import RunView
from ..runs import compose, trust
from ..runs.rewards import to_tune
from ..store.directory import output_directory
from ..tasks.registry import get
from ..text import plain
from ..types import Candidate, Verdict
from .show import facts, tuned
from .terminal import Terminal


def tune(words: Sequence[str], *, as_json: bool = False) -> None:
    """Fit the numbers of a reward, or go on with that where `dir=` holds it; print tables, leave a report.

    As JSON: what `eureka show --json` prints, and the directory; what people are told goes to stderr.
    """
    typed = parse(TuneConfig, words)
    get(typed.env)
    trust.remember(typed)
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        reward = to_tune(typed)
        directory = output_directory(typed.dir, typed.env, "tune_")
        run = go_on(typed.run(), directory, reward)
    if as_json:
        print(json.dumps({"directory": str(directory), **facts(run)}, indent=2))


def go_on(config: RunConfig, directory: Path, reward: tuple[Candidate, Verdict] | None) -> RunView:
    """Do what is missing, write the report and print what was found.

    Args:
        reward: None for that of the run.
    """
    problems = compose.tune(config, directory, reward, Terminal())
    run = RunView.read(directory)
    print("\n".join(["", *tuned(run)]))
    for problem in problems:
        print(plain(problem))
    print(f"\nEverything is in {directory}; begin with report.html")
    return run
