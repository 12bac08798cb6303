"""The functions that Python programs call: the command line's runs, told as events and handed back as an object."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from typing import TypedDict, Unpack

from ..config import NO_MODEL, RunConfig, TrainConfig, TuneConfig, absolute, taken
from ..errors import ConfigError, Interrupted
from ..llm.client import LanguageModel
from ..person import Desk
from ..report.filming import Filming
from ..store import Store, is_run
from ..store.directory import is_asked_to_stop, output_directory
from ..tasks.registry import get
from ..types import Generation, TrainingResult, Usage, Verdict
from . import compose, rewards, trust
from .events import Event, Started, Teller
from .run import Run

# --- settings: what they mean, the fields of `config.RunConfig` and `config.TrainConfig` say ------------------------


class _Shared(TypedDict, total=False):
    curriculum: str | Path
    randomise: str | Path
    observe: str
    seed: int
    seeds: int
    steps: int | float
    worlds: int
    bonus: str
    device: str
    threads: int
    executor: str
    address: str
    log: str
    dir: str | Path
    unsafe_no_sandbox: bool


class TrainSettings(_Shared, total=False):
    """All fields of `TrainConfig` but `env` and `reward`."""


class TuneSettings(_Shared, total=False):
    """All fields of `TuneConfig` but `env` and `reward`."""

    trials: int
    sample: int


class SearchSettings(_Shared, total=False):
    """All fields of `RunConfig` but `env` and `model`."""

    base_url: str
    sample: int
    iteration: int
    search: str
    schedule: str
    init: str | Path
    safety: str
    limits: str
    feedback: str
    feedback_timeout: float
    judge: str
    repair: int
    refill: int
    temperature: float
    max_cost: float
    price: str
    baselines: str
    video: str
    tune: int
    polish: int
    polish_steps: int | float


# --- calls -----------------------------------------------------------------------------------------------------------


Tell = Callable[[Event], object]
Work = Callable[[compose.Host], object]


def search(
    env: str | Path = "cartpole",
    *,
    model: str | LanguageModel = "local",
    on_event: Tell | None = None,
    **settings: Unpack[SearchSettings],
) -> Run:
    """Search for a reward, as `eureka run` does, and return the run when it is finished.

        run = openeureka.search("ant", model="gpt-5", sample=8, iteration=3, max_cost=5)

    Ctrl-C, which is also a notebook's stop button, stops it: what is under way is kept, one line says how to go on, and
    the run so far is returned. With the `dir` of a run that exists, it goes on with that.

    Args:
        env: a name of `eureka envs`, `FILE.py` or `pkg.mod:Class`.
        model: what `model=` names on the command line, or an object of your own that keeps the protocol
            `openeureka.llm.client.LanguageModel`.
        on_event: called with every `Event`, in order; what it raises ends the search.
        settings: those of `eureka run`, by the same names.

    Raises:
        ConfigError: for an unknown setting, or one that does not fit.
        EurekaError: what else a person can do something about; what was finished is kept.
    """
    config, directory, own = _searched(env, model, settings)
    return _done(directory, on_event, lambda host: compose.search(config, directory, host, own))


def searching(
    env: str | Path = "cartpole", *, model: str | LanguageModel = "local", **settings: Unpack[SearchSettings]
) -> Generator[Event]:
    """Search as `search` does, and yield every `Event` while it runs; the first, `Started`, holds the run.

        for event in openeureka.searching("ant", model="random"):
            if isinstance(event, openeureka.Generation):
                print(event.index, event.best.score)

    Leaving the loop stops the search, and nothing is lost: it takes about a second while lanes train, and up to a reply
    while the model writes. So does Ctrl-C.

    Args:
        env: as in `search`.
        model: as in `search`.
        settings: as in `search`.

    Raises:
        EurekaError: as `search` does; from the loop, what ended the search.
    """
    config, directory, own = _searched(env, model, settings)
    return _followed(lambda host: compose.search(config, directory, host, own))


def train(
    env: str | Path = "cartpole",
    reward: str | Path | Sequence[str | Path] = "human,sparse",
    *,
    on_event: Tell | None = None,
    **settings: Unpack[TrainSettings],
) -> Run:
    """Train given rewards side by side and compare them, as `eureka train` does; return the run when it is finished.

        run = openeureka.train("cartpole", ["human", "my_reward.py", text], seeds=3)

    Ctrl-C stops it as it stops `search`. What could not be trained has its reason in the run's rows.

    Args:
        env: as in `search`.
        reward: names and paths, separated by commas, or a list of names, paths and texts of programs. `human` and
            `sparse` come with the task. A text has several lines; it is called `reward_1` by its place in the list.
        on_event: as in `search`.
        settings: those of `eureka train`, by the same names.

    Raises:
        ConfigError: for an unknown setting, or one that does not fit.
        RewardFileError: for a reward that cannot be read or was refused.
        EurekaError: what else a person can do something about; what was finished is kept.
    """
    config = TrainConfig(**taken(TrainConfig, {"env": env, **settings}))
    get(config.env)
    trust.remember(config)
    programs = rewards.named(config, _listed(reward))
    directory = output_directory(config.dir, config.env, "train_")
    return _done(directory, on_event, lambda host: compose.train(config.run(), directory, programs, host))


def _listed(reward: str | Path | Sequence[str | Path]) -> list[str | Path]:
    if isinstance(reward, str) and "\n" not in reward:
        return [word.strip() for word in reward.split(",") if word.strip()]
    return [reward] if isinstance(reward, (str, Path)) else list(reward)


def tune(
    env: str | Path = "cartpole",
    reward: str | Path = "human",
    *,
    on_event: Tell | None = None,
    **settings: Unpack[TuneSettings],
) -> Run:
    """Fit the numbers of one reward, as `eureka tune` does, its structure kept; return the run when it is finished.

        run = openeureka.tune("ant", "my_reward.py", trials=32)
        print(run.verdict, run.best_reward)

    Ctrl-C stops it as it stops `search`. `run.tuned` holds the numbers before and after, and what each does to F.

    Args:
        env: as in `search`.
        reward: `human`, a path, the directory of a run, whose best reward it is, or the program as a text of several
            lines.
        on_event: as in `search`.
        settings: those of `eureka tune`, by the same names.

    Raises:
        ConfigError: for an unknown setting, one that does not fit, or a reward without numbers to fit.
        RewardFileError: for a reward that cannot be read or was refused.
        EurekaError: what else a person can do something about; what was finished is kept.
    """
    config = TuneConfig(**taken(TuneConfig, {"env": env, **settings}))
    get(config.env)
    trust.remember(config)
    program = rewards.to_tune(config, reward)
    directory = output_directory(config.dir, config.env, "tune_")
    return _done(directory, on_event, lambda host: compose.tune(config.run(), directory, program, host))


def check(env: str | Path, program: str | Path, *, unsafe_no_sandbox: bool = False) -> Verdict:
    """The verdict on one reward, as `eureka check` gives it: whether it can train, and if not, why.

    Args:
        env: as in `search`.
        program: a path, or the program as a text of several lines, which may be a model's whole answer.
        unsafe_no_sandbox: run it in an unconfined child process where the kernel cannot confine it.

    Raises:
        TaskError: for a task that does not exist.
        RewardFileError: for a file that cannot be read.
        SandboxUnavailable: where the kernel cannot confine it.
    """
    candidate = rewards.read(program)
    return rewards.judge(absolute("env", str(env)), [candidate], unsafe=unsafe_no_sandbox)[0]


def open_run(directory: str | Path) -> Run:
    """A run that exists, finished, stopped or at work. Nothing that it names is used.

    Raises:
        StoreError: when there is none.
    """
    Store.view(directory).close()
    return Run(Path(directory))


def resume(
    run: Run, *, model: LanguageModel | None, trust: bool, on_event: Tell | None, settings: Mapping[str, object]
) -> Run:
    """See `Run.resume`."""
    directory = run.directory
    config = replace(compose.stored(directory), **taken(RunConfig, settings))
    _agree(config, directory, typed=[*settings, *(["model"] if model is not None else [])], trusted=trust)
    if config.model == NO_MODEL:
        work = compose.tune if config.tune else compose.train
        return _done(directory, on_event, lambda host: work(config, directory, None, host))
    return _done(directory, on_event, lambda host: compose.search(config, directory, host, model))


def _agree(config: RunConfig, directory: Path, *, typed: Sequence[str], trusted: bool) -> None:
    asked = {key: value for key, value in trust.unknown(config).items() if key not in typed}
    if asked and not trusted:
        listed = ", ".join(f"{key}={value}" for key, value in asked.items())
        raise ConfigError(
            f"{directory} would use what was never used here: {listed}; call resume(trust=True) if you know where it "
            "comes from."
        )
    trust.remember(config)


def _searched(
    env: str | Path, model: str | LanguageModel, settings: Mapping[str, object]
) -> tuple[RunConfig, Path, LanguageModel | None]:
    """The settings of a search, its directory, and the model where it is an object."""
    own, name = (None, model) if isinstance(model, str) else (model, model.name)
    typed = taken(RunConfig, {"env": env, "model": name, **settings})
    config = compose.admitted(RunConfig(**typed), typed)
    return config, output_directory(config.dir, config.env), own


@dataclass(frozen=True, slots=True)
class _Program:
    """A Python program as the host of a run (see `compose.Host`): it hears events, and nothing is printed.

    No signal reaches any thread but the main one. A run in another stops where it tells of something, or waits for a
    person: when `leaving` is set, or `eureka stop` asks for it.
    """

    tell: Tell
    leaving: threading.Event | None = None
    """None in the main thread."""

    def begins(self, config: RunConfig, directory: Path) -> None: ...

    def working(self, text: str) -> AbstractContextManager[None]:
        return nullcontext()

    @contextmanager
    def view(self, config: RunConfig, directory: Path, usage: Usage) -> Iterator[Teller]:
        def tell(event: Event) -> None:
            self.tell(event)
            if not isinstance(event, TrainingResult):  # the next one may be waiting: it is to be kept first
                self.obey(directory)

        tell(Started(Run(directory)))
        yield Teller(tell)

    def obey(self, directory: Path) -> None:
        """Raises KeyboardInterrupt where the run is to stop and no signal says so."""
        if self.leaving is not None and (self.leaving.is_set() or is_asked_to_stop(directory)):
            raise KeyboardInterrupt

    def desk(self, config: RunConfig, directory: Path, films: Sequence[Filming]) -> Desk:
        return _Desk(self, directory)

    def again(self, directory: Path) -> str:
        return f"openeureka.open_run({str(directory)!r}).resume()"


@dataclass(frozen=True, slots=True)
class _Desk:
    """Nobody sits here; `eureka feedback` and the page reach the run all the same."""

    host: _Program
    directory: Path

    def invite(self, generation: Generation) -> None: ...

    def listen(self, seconds: float) -> None:
        time.sleep(seconds)
        self.host.obey(self.directory)


def host(on_event: Tell | None) -> compose.Host:
    """This program, as the host of runs that it waits for."""
    in_main = threading.current_thread() is threading.main_thread()
    return _Program(on_event or (lambda event: None), None if in_main else threading.Event())


def _done(directory: Path, on_event: Tell | None, work: Work) -> Run:
    """The run after the work, or as far as it came when it was stopped."""
    try:
        work(host(on_event))
    except Interrupted as stop:
        if not is_run(directory):
            raise KeyboardInterrupt from None
        print(stop)
    return Run(directory)


def _followed(work: Work) -> Generator[Event]:
    """The events of a run at work in a thread of its own."""
    events: SimpleQueue[Event | None] = SimpleQueue()
    leaving = threading.Event()
    failures: list[BaseException] = []

    def run() -> None:
        try:
            work(_Program(events.put, leaving))
        except BaseException as error:  # whatever it is, it is raised where somebody looks
            failures.append(error)
        finally:
            events.put(None)

    thread = threading.Thread(target=run, name="openeureka", daemon=True)
    thread.start()
    try:
        while (event := events.get()) is not None:
            yield event
    except KeyboardInterrupt:
        leaving.set()
    finally:
        leaving.set()
        thread.join()
    for failure in failures:
        if not isinstance(failure, Interrupted):
            raise failure
        print(failure)
