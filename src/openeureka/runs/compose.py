"""Puts the parts of a run together, and has it report. A run's host is what started it: a terminal or a program."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

from .. import loop, strategies
from ..config import NO_MODEL, RobustConfig, RunConfig, TrainConfig, TuneConfig
from ..display.log import logged
from ..display.trackers import mirrored
from ..errors import ConfigError, Interrupted
from ..events import Tell, everyone
from ..llm import expect, open_model
from ..llm.client import LanguageModel
from ..llm.registry import KINDS, priced
from ..method import baselines, given, sampling
from ..method.given import Given
from ..method.lanes import Lanes
from ..method.person import Desk
from ..parsing import command_line, whole_path
from ..refine import tuning
from ..refine.hardened import GRID
from ..refine.hardening import Robot, harden, planned
from ..report.build import build
from ..report.filming import Filming
from ..sandbox.client import Sandbox
from ..store import Store, has_begun, look, read_config, read_replies
from ..store.directory import expect_free, swept
from ..tasks import costs, ranges
from ..tasks.context import context, informed
from ..tasks.record import record_states, try_out
from ..tasks.registry import get
from ..types import Candidate, Ranks, Trainer, Usage, Verdict
from . import inputs, trainers, trust
from .stopping import continuable, stoppable, stopped
from .trainers import expect_storable, trainer_of


class Host(Protocol):
    """What started a run, is told of its progress, and knows where its person sits."""

    def begins(self, config: RunConfig, directory: Path) -> None:
        """Called when wrong settings have been refused, and nothing of the run is made yet."""
        ...

    def working(self, text: str) -> AbstractContextManager[None]:
        """Around work that takes long and tells no events."""
        ...

    def view(self, config: RunConfig, directory: Path, usage: Usage) -> AbstractContextManager[Tell]:
        """Entered when the run is at work; `usage` is what earlier processes spent on it."""
        ...

    def desk(self, config: RunConfig, directory: Path, films: Sequence[Filming]) -> Desk: ...

    def again(self, directory: Path) -> str:
        """The command or call that continues the run."""
        ...


def admitted(config: RunConfig, typed: Collection[str]) -> RunConfig:
    """The settings of a new search, checked and completed. What they reach outside the run is recorded as typed.

    Args:
        typed: the settings that were given.

    Raises:
        ConfigError: where they do not fit each other.
    """
    if config.model == NO_MODEL:
        raise ConfigError("model=none runs no search; use `eureka train` to train and compare given rewards.")
    for key in ("base_url", "price"):
        if getattr(config, key) and config.model.partition(":")[0] in KINDS:
            raise ConfigError(
                f"model={config.model} does not use {key}=. Leave {key}= out, or name the endpoint's model with "
                "model=NAME."
            )
    if config.feedback_timeout and config.feedback == "none":
        raise ConfigError("`feedback_timeout` works only with feedback=human; add that, or leave it out.")
    once = config.iteration == 1 and not config.init
    if once and config.feedback == "human" and config.judge == "fitness":
        raise ConfigError(
            "feedback=human is read between generations, but this search has one; use iteration=2 or more."
        )
    if once and config.screen > 1:
        raise ConfigError("`screen` judges by an earlier generation, but this search has one; use iteration=2 or more.")
    if config.judge == "votes" and config.tune:
        raise ConfigError("`tune` picks by F, against judge=votes; leave it out, or use `eureka tune` afterwards.")
    expect(config)
    if config.feedback == "human" and "video" not in typed:
        config = replace(config, video="all")  # a person judges by what they see
    trust.remember(config)
    return config


def as_begun(config: RunConfig, old: RunConfig) -> RunConfig:
    """Settings for a search that has begun: where they leave `sample` or `iteration` open, it keeps its own."""
    return replace(config, sample=config.sample or old.sample, iteration=config.iteration or old.iteration)


def stored(directory: Path) -> RunConfig:
    """The settings of a run that is continued. `unsafe_no_sandbox` is never taken from a store."""
    return replace(read_config(directory), unsafe_no_sandbox=False)


def search(config: RunConfig, directory: Path, host: Host, model: LanguageModel | None = None) -> list[str]:
    """Search, or continue a search, then report. Wrong settings are refused before a directory is made.

    Args:
        model: used in place of the one that the settings name.

    Returns:
        Sentences about parts of the report that could not be made.

    Raises:
        Interrupted: stopped by Ctrl-C or `eureka stop`; all that was finished is stored.
        EurekaError: any other error that ended the search.
    """
    begun = has_begun(directory)
    with swept(directory), mirrored(directory, config) as mirrors:
        try:
            with _prepared(config, directory, host, model, mirrors) as work:
                work()
        except KeyboardInterrupt:  # before the search was at work
            begun = begun or has_begun(directory)
            raise Interrupted(stopped(host.again(directory)) if begun else "Stopped before it began.") from None
        doing = "Writing the report" if config.video == "none" else "Filming, and writing the report"
        problems = _reported(config, directory, host, "search", doing)
        for mirror in mirrors:
            mirror.films()
        return problems


def _reported(
    config: RunConfig, directory: Path, host: Host, done: str, doing: str = "Writing the report"
) -> list[str]:
    """Write the report, and return sentences about parts that could not be made. The run is complete without it.

    Raises:
        Interrupted: stopped by Ctrl-C.
    """
    try:
        with host.working(doing):
            return build(directory, config.video, config.env)
    except KeyboardInterrupt:
        command = command_line("report", directory)
        raise Interrupted(f"Stopped; the {done} is done. Write its report with: {command}") from None


def expect_fit(config: RunConfig, directory: Path) -> None:
    """Refuse a search whose settings name what does not exist, or do not fit its task or each other. Starts nothing and
    opens no model. Raises EurekaError."""
    _expect_choices(config, directory)
    strategies.SEARCHES.find(config.search)
    trainers.expect_fit(config)


def _expect_choices(config: RunConfig, directory: Path) -> None:
    baselines.chosen(config)  # refuses what was not measured
    costs.check(config.env, config.cost_limits)
    if config.init and not has_begun(directory):
        sampling.init_candidate(config)  # refuses what cannot be read


def comparison(typed: TrainConfig | TuneConfig) -> RunConfig:
    """The settings of a new run of given rewards, checked before these are judged, which takes long. What they reach
    outside the run is recorded as typed. Raises EurekaError where they do not fit each other."""
    get(typed.env)
    trust.remember(typed)
    config = typed.run_config()
    if config.dir:
        expect_free(whole_path(config.dir), config)
    trainers.expect_fit(config)
    return config


@contextmanager
def _prepared(
    config: RunConfig, directory: Path, host: Host, model: LanguageModel | None, mirrors: Sequence[Tell]
) -> Iterator[Callable[[], object]]:
    """The search as a function to call while everything that it needs is open."""
    task = context(config.env)
    begun = has_begun(directory)
    _expect_choices(config, directory)
    trainer = trainer_of(config, directory)
    with closing(priced(model, config) if model is not None else _model(config, directory)) as model:
        if begun:  # its model may replay its own replies, which do not tell the style of their prompts
            config = as_begun(config, read_config(directory))
        config = strategies.sized(config, model.style)
        strategy = strategies.make(config)  # refuses an unknown search
        expect_free(directory, config)
        with host.working("Trying the task out"):
            states = record_states(config.env)
        host.begins(config, directory)
        task = informed(task, states, config)
        worlds = config.worlds or get(config.env).recipe.worlds
        with Sandbox(task.state, states, worlds=worlds, unsafe=config.unsafe_no_sandbox) as checker:
            if not begun:
                sampling.admit(config, checker)
            with (
                _store(directory, config, strategy.ranks) as store,
                _at_work(store, config, host, host.again(directory), mirrors, _filming(directory, config, host)) as (
                    tell,
                    films,
                ),
            ):
                desk = host.desk(config, directory, films)
                yield partial(loop.run, config, store, model, checker, trainer, task, strategy, tell, desk)


def _model(config: RunConfig, directory: Path) -> LanguageModel:
    """The model that the settings name. A run that has all its generations gets a replay of its own replies: it asks
    for no more, and the key or the weights may be gone.
    """
    if not has_begun(directory):
        return open_model(config, held=0)
    before, glance = look(directory)
    if 0 < before.generations <= glance.generations:
        config = replace(config, model=f"replay:{directory}")
    return open_model(config, held=len(read_replies(directory)))


@contextmanager
def _filming(directory: Path, config: RunConfig, host: Host) -> Iterator[list[Filming]]:
    """What films all policies while the search goes on; empty without `video=all`."""
    if config.video != "all":
        yield []
        return
    with Filming(directory, config) as films:
        yield [films]
        if films.waiting:
            with host.working(f"Filming the last {films.waiting} policies"):
                films.wait()


def train(config: RunConfig, directory: Path, rewards: Given | None, host: Host) -> list[str]:
    """Train what is missing of a run of given rewards, then report.

    Args:
        rewards: None for the rewards that the run holds.

    Returns, Raises:
        As `search` does.
    """
    with swept(directory):
        expect_free(directory, config)
        trainer = trainer_of(config, directory)
        if rewards is not None and not any(rewards.values()):  # else judging their programs has tried it
            with host.working("Trying the task out"):
                try_out(config.env)
        keep = partial(given.keep, rewards=rewards) if rewards is not None else None
        with comparing(config, directory, host, keep, trainer) as lanes:
            given.train(lanes)
            lanes.store.end()
    return _reported(config, directory, host, "training")


def tune(config: RunConfig, directory: Path, reward: tuple[Candidate, Verdict] | None, host: Host) -> list[str]:
    """Do what is missing of a tuning, then report.

    Args:
        reward: the reward whose numbers are fitted; None for the one that the run holds.

    Returns, Raises:
        As `search` does.
    """
    task = get(config.env)
    worlds = config.worlds or task.recipe.worlds
    keep = partial(tuning.keep, origin=reward[0], verdict=reward[1]) if reward is not None else None
    with swept(directory):
        expect_free(directory, config)
        trainer = trainer_of(config, directory)
        with host.working("Trying the task out"):
            states = record_states(config.env)
        with (
            Sandbox(task.spec, states, worlds=worlds, unsafe=config.unsafe_no_sandbox) as checker,
            comparing(config, directory, host, keep, trainer) as lanes,
        ):
            tuning.tune(lanes, checker)
            lanes.store.end()
    return _reported(config, directory, host, "tuning")


def robust(
    wanted: RobustConfig,
    config: RunConfig,
    directory: Path,
    host: Host,
    model: LanguageModel | None = None,
    *,
    again: str,
) -> list[str]:
    """Do what is missing to make the best policy of a run robust, then report.

    Args:
        config: the run's settings with what `wanted` changes: the model, how many proposals it makes, where they train.
        model: used in place of the one that the settings name.
        again: the command or call that continues the hardening; `Host.again` names the one that continues the run.

    Returns:
        As `search` does.

    Raises:
        ConfigError: for a task of which nothing can be changed, a run without a model or a policy, and another start or
            number of steps than before.
        EurekaError: as `search` does.
    """
    task = get(config.env)
    if task.steps_itself:
        raise ConfigError(f"openeureka does not simulate `{task.env}` itself, so its physics cannot be varied.")
    if config.model == NO_MODEL:
        raise ConfigError("The run has no model. Name one, such as model=gpt-5, or use model=random for random ranges.")
    with Store.view(directory) as store:
        training = planned(store, wanted.start, wanted.steps)
    expect_storable(config, config.env, training.steps, "steps=")
    trainer, mechanics = trainer_of(config, directory), task.compile_model()
    robot = Robot(
        task=task.description,
        description=ranges.described(task, mechanics),
        quantities=tuple(name for name in GRID if not ranges.useless(task, mechanics, name)),
        uniform=ranges.uniform(task, mechanics),
        read=lambda text: ranges.written(task, mechanics, text, "the reply"),
    )
    began = stored(directory)
    with (
        mirrored(directory, began) as mirrors,
        closing(priced(model, config) if model is not None else open_model(config)) as model,
        _store(directory, began) as store,
        _at_work(store, config, host, again, mirrors) as (tell, _),
    ):
        harden(Lanes(config, store, trainer, tell), model, robot, training)
    return _reported(config, directory, host, "hardening")


@contextmanager
def comparing(
    config: RunConfig,
    directory: Path,
    host: Host,
    keep: Callable[[Store], object] | None = None,
    trainer: Trainer | None = None,
) -> Iterator[Lanes]:
    """The lanes of a run of given rewards, new or continued, while it is at work.

    Args:
        keep: stores the rewards. It is called first, because resuming the run is no remedy where it refuses them.
        trainer: made before other work, because that may refuse settings; None makes it here.
    """
    trainer = trainer or trainer_of(config, directory)
    host.begins(config, directory)
    with mirrored(directory, config) as mirrors, _store(directory, config) as store:
        if keep is not None:
            keep(store)
        with _at_work(store, config, host, host.again(directory), mirrors) as (tell, _):
            yield Lanes(config, store, trainer, tell)


@contextmanager
def _at_work(
    store: Store,
    config: RunConfig,
    host: Host,
    again: str,
    mirrors: Sequence[Tell],
    filming: AbstractContextManager[Sequence[Filming]] | None = None,
) -> Iterator[tuple[Tell, Sequence[Filming]]]:
    """A `Tell` for all that listen to a run, and those of them that film it, while it is at work and can be stopped.

    Args:
        config: the settings that it works with, which may differ from those that it began with.
        again: the command or call that continues it.
        filming: on exit it waits for films under way, when the view is closed but a request to stop is still heard.
    """
    directory, usage = store.directory, store.talk.usage()
    with (
        continuable(again, store),
        stoppable(directory),
        logged(directory, config, usage) as log,
        filming or nullcontext(()) as films,
        host.view(config, directory, usage) as view,
    ):
        yield everyone(*log, *films, *mirrors, view), films


@contextmanager
def _store(directory: Path, config: RunConfig, ranks: Ranks = "played") -> Iterator[Store]:
    """The store of a run while it is at work. Raises ConfigError where a file that its settings name has changed."""
    with Store.open(directory, config, ranks) as store:
        inputs.keep(config, directory)
        yield store
