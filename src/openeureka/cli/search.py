"""`eureka run` and `eureka resume`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..config import NO_MODEL, RunConfig, changed, parse
from ..report.view import RunView
from ..runs import compose, trust
from ..store.directory import output_directory
from ..text import plain
from . import training
from .settings import only_path, split
from .show import summary
from .terminal import Terminal


def run(words: Sequence[str]) -> None:
    """Start a search, or continue the one that `dir=` holds."""
    config = compose.admitted(parse(RunConfig, words), _keys(words))
    directory = output_directory(config.dir, config.env)
    _tell(directory, compose.search(config, directory, Terminal()))


def resume(words: Sequence[str]) -> None:
    """Continue a run; settings that do not change what is searched may be given anew.

    What the stored settings reach outside the run is agreed to first, see `trust`.
    """
    settings, paths = split(words)
    directory = only_path(paths, "eureka resume outputs/<time>_cartpole")
    trusted = [word.removeprefix("trust=") for word in settings if word.startswith("trust=")]
    settings = [word for word in settings if not word.startswith("trust=")]
    config = changed(compose.stored(directory), settings)
    trust.agree(config, directory, typed=_keys(settings), trusted=Path(trusted[-1]) if trusted else None)
    if config.model == NO_MODEL:
        training.resume(config, directory)
    else:
        _tell(directory, compose.search(config, directory, Terminal()))


def _keys(words: Sequence[str]) -> set[str]:
    return {word.partition("=")[0] for word in words}


def _tell(directory: Path, problems: Sequence[str]) -> None:
    """What the search has found, and what of its report could not be made."""
    result = RunView.read(directory)
    if result.best is not None and result.best.candidate is not None:
        print(f"\nBest reward:\n\n{plain(result.best.candidate.source)}")
    print("\n".join(summary(result)))
    for problem in problems:
        print(plain(problem))
    print(f"\nEverything is in {directory}; begin with report.html")
