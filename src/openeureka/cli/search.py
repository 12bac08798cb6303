"""`eureka run` and `eureka resume`: puts the parts of a search together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from .. import loop, search
from ..config import RunConfig, as_dict, parse, short_name
from ..errors import EurekaError
from ..llm import open_model
from ..observer import Observers
from ..report.build import build
from ..report.filming import Filming
from ..report.text import plain
from ..report.view import RunView
from ..sandbox.client import Sandbox
from ..store import Store, is_run, read_config, read_replies
from ..store.paths import output_directory
from ..tasks.context import context, informed
from ..tasks.record import record_states
from .desk import TerminalDesk
from .live import view
from .log import logged
from .settings import only_path, split
from .show import summary
from .stop import stoppable
from .trainer import trainer_of


class Interrupted(EurekaError):
    """Ctrl-C."""

    exit_code = 130


def run(words: Sequence[str]) -> None:
    """Start a search, or continue the one that `dir=` holds."""
    config = parse(RunConfig, words)
    if config.feedback == "human" and not any(word.startswith("video=") for word in words):
        config = replace(config, video="all")  # who is to judge needs to see
    _search(config, output_directory(config.dir, config.env))


def resume(words: Sequence[str]) -> None:
    """Continue a search; settings that do not change what is searched may be given anew."""
    settings, paths = split(words)
    directory = only_path(paths, "eureka resume outputs/<time>_cartpole")
    stored = [f"{key}={value}" for key, value in as_dict(read_config(directory)).items()]
    _search(parse(RunConfig, [*stored, *settings]), directory)


def _search(config: RunConfig, directory: Path) -> None:
    known = context(config.env)
    trainer = trainer_of(config, directory, lanes=directory / "lanes")
    model = open_model(config, held=len(read_replies(directory)) if is_run(directory) else 0)
    config = search.sized(config, model.style)
    size = f"{config.iteration} generations of {config.sample} rewards"
    print(f"{short_name(config.env)}: {size} by {config.model}, in {directory}")
    try:
        states = record_states(config.env)
        known = informed(known, states, config)
        with (
            Sandbox(known.state, states, unsafe=config.unsafe_no_sandbox) as checker,
            Store.open(directory, config) as store,
            _telling_how_to_continue(directory),
            stoppable(directory),
            logged(directory, config, store.usage()) as log,
            _filming(directory, config) as films,
            view(config, store.usage()) as table,
        ):
            desk = TerminalDesk(directory, config, films)
            strategy = search.make(config, store.ranks)
            loop.run(config, store, model, checker, trainer, known, strategy, Observers(table, *log, *films), desk)
    finally:
        model.close()
    _conclude(config, directory)


@contextmanager
def _telling_how_to_continue(directory: Path) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(f"Stopped, nothing is lost. Continue with: eureka resume {directory}") from None
    except EurekaError as error:
        error.add_note(f"What is done is kept. Continue with: eureka resume {directory}")
        raise


@contextmanager
def _filming(directory: Path, config: RunConfig) -> Iterator[list[Filming]]:
    """The one who films all policies while the search goes on, if they are wanted."""
    if config.video != "all":
        yield []
        return
    with Filming(directory, config) as films:
        yield [films]
        if films.waiting:
            print(f"Filming the last {films.waiting} policies")


def _conclude(config: RunConfig, directory: Path) -> None:
    """Reports come last: the search is complete without them."""
    problems = build(directory, config.video)
    result = RunView.read(directory)
    if result.best is not None and result.best.candidate is not None:
        print(f"\nBest reward:\n\n{plain(result.best.candidate.source)}")
    print("\n".join(summary(result)))
    for problem in problems:
        print(plain(problem))
    print(f"\nEverything is in {directory}; begin with report.html")
