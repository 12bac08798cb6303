"""`eureka tune` and `eureka robust`: what is done with a reward that is found."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path

from ..config import RobustConfig, RunConfig, TuneConfig
from ..parsing import parse
from ..report.view import RunView
from ..runs import compose, trust
from ..runs.rewards import to_tune
from ..store.directory import output_directory
from ..tasks.registry import get
from ..text import plain
from ..types import Candidate, Verdict
from .settings import only_path, split, trusting
from .show import closing, facts, tuned
from .show import robust_lines as lines
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


def robust(words: Sequence[str]) -> None:
    """Do what is missing to make the best policy of a run robust, write the report and print what was found."""
    settings, paths = split(words)
    directory = only_path(paths, "eureka robust outputs/<time>_anymal")
    settings, trusted = trusting(settings, directory)
    typed = {word.partition("=")[0] for word in settings}
    wanted = parse(RobustConfig, settings)
    config = wanted.changed(compose.stored(directory), typed)
    trust.agree(config, directory, typed=typed, trusted=trusted, way=f"add trust={directory}", asks=True)
    again = shlex.join(["eureka", "robust", str(directory), *settings])
    problems = compose.robust(wanted, config, directory, Terminal(), again=again)
    found = RunView.read(directory).robust
    if found is not None:
        print("\n".join(["", *lines(found)]))
    for problem in problems:
        print(plain(problem))
    print(f"\nThe policy and its ranges are in {directory / 'robust'}; begin with report.html")


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
    print("\n".join(closing(run, directory)))
    return run
