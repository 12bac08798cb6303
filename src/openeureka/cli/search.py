"""`eureka run` and `eureka resume`: puts the parts of a search together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from .. import baselines, loop, sampling, search
from ..config import NO_MODEL, RunConfig, changed, parse, short_name
from ..errors import ConfigError, Interrupted
from ..llm import open_model
from ..llm.client import LanguageModel
from ..llm.registry import KINDS
from ..observer import Observers
from ..report.build import build
from ..report.filming import Filming
from ..report.view import RunView
from ..sandbox.client import Sandbox
from ..store import Store, is_run, read_config, read_replies
from ..store.paths import output_directory
from ..tasks.context import context, informed
from ..tasks.record import record_states
from ..tasks.registry import get
from ..text import one_line, plain
from ..types import TaskContext, Trainer
from . import training, trust
from .desk import TerminalDesk
from .live import view
from .log import logged
from .progress import working
from .settings import only_path, split
from .show import summary
from .stop import continuable, stoppable, stopped
from .trainer import trainer_of

Parts = tuple[
    RunConfig, Store, LanguageModel, Sandbox, Trainer, TaskContext, search.SearchStrategy, Observers, TerminalDesk
]
"""Arguments of `loop.run`."""


def run(words: Sequence[str]) -> None:
    """Start a search, or continue the one that `dir=` holds."""
    config = parse(RunConfig, words)
    if config.model == NO_MODEL:
        raise ConfigError("model=none searches for nothing; `eureka train` trains and compares given rewards.")
    if config.base_url and config.model.partition(":")[0] in KINDS:
        raise ConfigError(f"model={config.model} is at no endpoint: name the one at base_url= with model=NAME.")
    if config.feedback == "human" and not any(word.startswith("video=") for word in words):
        config = replace(config, video="all")  # who is to judge needs to see
    trust.remember(config)
    _search(config, output_directory(config.dir, config.env))


def resume(words: Sequence[str]) -> None:
    """Continue a run; settings that do not change what is searched may be given anew.

    What the stored settings reach outside the run is agreed to first, see `trust`. That generated programs need no
    sandbox is never taken from a store.
    """
    settings, paths = split(words)
    directory = only_path(paths, "eureka resume outputs/<time>_cartpole")
    trusted = [word.removeprefix("trust=") for word in settings if word.startswith("trust=")]
    settings = [word for word in settings if not word.startswith("trust=")]
    config = changed(replace(read_config(directory), unsafe_no_sandbox=False), settings)
    typed = {word.partition("=")[0] for word in settings}
    trust.agree(config, directory, typed=typed, trusted=Path(trusted[-1]) if trusted else None)
    if config.model == NO_MODEL:
        training.resume(config, directory)
    else:
        _search(config, directory)


def _search(config: RunConfig, directory: Path) -> None:
    """Search, then report."""
    begun = is_run(directory)
    try:
        with _parts(config, directory) as parts:
            loop.run(*parts)
    except KeyboardInterrupt:  # before the search, or a resumed one, was at work
        raise Interrupted(stopped(directory) if begun or is_run(directory) else "Stopped before it began.") from None
    try:
        _conclude(config, directory)
    except KeyboardInterrupt:
        raise Interrupted(f"Stopped; the search is done. Write its report with: eureka report {directory}") from None


@contextmanager
def _parts(config: RunConfig, directory: Path) -> Iterator[Parts]:
    """What a search is made of, as long as it is at work. What a person can get wrong is refused before a directory is
    made."""
    known = context(config.env)
    baselines.chosen(config)
    begun = is_run(directory)
    if config.init and not begun:
        sampling.given(config)
    trainer = trainer_of(config, directory)
    model = open_model(config, held=len(read_replies(directory)) if begun else 0)
    config = search.sized(config, model.style)
    search.make(config)  # refuses what is none; which one it will be, the store says
    size = f"{config.iteration} generations of {config.sample} rewards"
    print(f"{short_name(config.env)}: {size}, written by model={one_line(config.model)}, in {directory}")
    if config.model == "random":
        print("model=random draws by chance and reads neither results nor words. It is the control for a real model.")
    with working("Trying the task out"):
        states = record_states(config.env)
    known = informed(known, states, config)
    try:
        worlds = config.worlds or get(config.env).recipe.worlds
        with Sandbox(known.state, states, worlds=worlds, unsafe=config.unsafe_no_sandbox) as checker:
            if not begun:
                sampling.admit(config, checker)
            with (
                Store.open(directory, config) as store,
                continuable(directory),
                stoppable(directory),
                logged(directory, config, store.usage()) as log,
                _filming(directory, config) as films,
                view(config, store.usage()) as table,
            ):
                desk = TerminalDesk(directory, config, films)
                strategy = search.make(config, store.ranks)
                yield config, store, model, checker, trainer, known, strategy, Observers(table, *log, *films), desk
    finally:
        model.close()


@contextmanager
def _filming(directory: Path, config: RunConfig) -> Iterator[list[Filming]]:
    """The one who films all policies while the search goes on, if they are wanted."""
    if config.video != "all":
        yield []
        return
    with Filming(directory, config) as films:
        yield [films]
        if films.waiting:
            with working(f"Filming the last {films.waiting} policies"):
                films.wait()


def _conclude(config: RunConfig, directory: Path) -> None:
    """Reports come last: the search is complete without them."""
    films = "Writing the report" if config.video == "none" else "Filming, and writing the report"
    with working(films):
        problems = build(directory, config.video, config.env)
    result = RunView.read(directory)
    if result.best is not None and result.best.candidate is not None:
        print(f"\nBest reward:\n\n{plain(result.best.candidate.source)}")
    print("\n".join(summary(result)))
    for problem in problems:
        print(plain(problem))
    print(f"\nEverything is in {directory}; begin with report.html")
