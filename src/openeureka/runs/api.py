"""The functions that Python programs call: they start the command line's runs, and return them as objects."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Unpack

from ..config import RobustConfig, RunConfig, TrainConfig, TuneConfig
from ..errors import ConfigError
from ..llm.client import LanguageModel
from ..llm.registry import expect_model
from ..parsing import absolute, short_path, taken, whole_path
from ..store import Store
from ..store.directory import output_directory
from ..types import Verdict
from . import compose, rewards
from .program import Event, Tell, done, followed
from .run import Run
from .settings import RobustSettings, SearchSettings, TrainSettings, TuneSettings
from .trust import agree


def search(
    env: str | Path = "cartpole",
    *,
    model: str | LanguageModel = "local",
    on_event: Tell | None = None,
    **settings: Unpack[SearchSettings],
) -> Run:
    """Search for a reward, as `eureka run` does, and return the run when it is finished.

        run = openeureka.search("ant", model="gpt-5", sample=8, iteration=3, max_cost=5)

    Ctrl-C, which is also a notebook's stop button, stops the search: what is under way is kept, one line says how to go
    on, and the run so far is returned. With the `dir` of an existing run, the search continues that run.

    Args:
        env: a name of `eureka envs`, `FILE.py`, `pkg.mod:Class`, `gym:ID`, or a task in another Python, such as
            `python:FILE.py:NAME` or `dmc:DOMAIN-TASK`; the setting `python` is then the path of that interpreter.
        model: what `model=` names on the command line, or an object of your own with the protocol
            `openeureka.llm.client.LanguageModel`.
        on_event: called with every `Event`, in order; an exception that it raises ends the search.
        settings: those of `eureka run`, by the same names.

    Raises:
        ConfigError: for an unknown setting, or one that does not fit.
        EurekaError: for anything else that a person can mend; what was finished is kept.
    """
    config, own = _searched(env, model, settings)
    directory = output_directory(config.dir, config.env)
    return done(directory, on_event, lambda host: compose.search(config, directory, host, own), own=own is not None)


def searching(
    env: str | Path = "cartpole", *, model: str | LanguageModel = "local", **settings: Unpack[SearchSettings]
) -> Generator[Event]:
    """Search as `search` does, and yield every `Event` while it runs; the first, `Started`, holds the run.

        for event in openeureka.searching("ant", model="random"):
            if isinstance(event, openeureka.Generation):
                print(event.index, event.best and event.best.score)

    Leaving the loop stops the search, as Ctrl-C does, and nothing is lost. It takes about a second while lanes train,
    and up to a reply while the model writes. A generator in a variable of yours goes on until its `close()`.

    Args:
        env: as in `search`.
        model: as in `search`.
        settings: as in `search`.

    Raises:
        EurekaError: as in `search`. An error that ends a running search is raised in the loop.
    """
    config, own = _searched(env, model, settings)

    def work(host: compose.Host) -> None:
        compose.search(config, output_directory(config.dir, config.env), host, own)

    return followed(work, own=own is not None)


def train(
    env: str | Path = "cartpole",
    reward: str | Path | Sequence[str | Path] = "human,sparse",
    *,
    on_event: Tell | None = None,
    **settings: Unpack[TrainSettings],
) -> Run:
    """Train given rewards side by side and compare them, as `eureka train` does; return the run when it is finished.

        run = openeureka.train("cartpole", ["human", "my_reward.py", text], seeds=3)

    Ctrl-C stops it as it stops `search`. For a training that failed, `message` in the run's rows has the reason.

    Args:
        env: as in `search`.
        reward: names and paths, separated by commas, or a list of names, paths and texts of programs. `human` and
            `sparse` come with the task. A text has several lines, or begins with `def`; it is named after its place in
            the list, such as `reward_1`.
        on_event: as in `search`.
        settings: those of `eureka train`, by the same names.

    Raises:
        ConfigError: for an unknown setting, or one that does not fit.
        RewardFileError: for a reward that cannot be read or was refused.
        EurekaError: for anything else that a person can mend; what was finished is kept.
    """
    typed, listed = TrainConfig(**taken(TrainConfig, {"env": env, **settings})), _listed(reward)
    config = compose.comparison(typed)
    programs = rewards.named(typed, listed)
    directory = output_directory(typed.dir, typed.env, "train_")
    return done(directory, on_event, lambda host: compose.train(config, directory, programs, host))


def _listed(reward: str | Path | Sequence[str | Path]) -> list[str | Path]:
    if isinstance(reward, str) and not rewards.is_text(reward):
        return [*rewards.listed(reward)]
    words = list(reward) if isinstance(reward, Iterable) and not isinstance(reward, str) else [reward]
    for word in words:
        _expect("reward", word, "names, paths and texts of programs")
    return words


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
        reward: `human`, the path of a file, the program as a text of several lines, or the directory of a run, whose
            best reward is tuned. None of that run's settings is used.
        on_event: as in `search`.
        settings: those of `eureka tune`, by the same names.

    Raises:
        ConfigError: for an unknown setting, one that does not fit, or a reward without numbers to fit.
        RewardFileError: for a reward that cannot be read or was refused.
        EurekaError: for anything else that a person can mend; what was finished is kept.
    """
    _expect("reward", reward, "a name, a path or the text of a program")
    typed = TuneConfig(**taken(TuneConfig, {"env": env, **settings}))
    config = compose.comparison(typed)
    program = rewards.to_tune(typed, reward)
    directory = output_directory(typed.dir, typed.env, "tune_")
    return done(directory, on_event, lambda host: compose.tune(config, directory, program, host))


def robust(
    run: Run | str | Path,
    *,
    model: str | LanguageModel = "",
    trust: bool = False,
    on_event: Tell | None = None,
    **settings: Unpack[RobustSettings],
) -> Run:
    """Make the best policy of a run robust, as `eureka robust` does, and return the run.

        run = openeureka.robust("outputs/my_run", model="gpt-5", sample=8)
        print(run.robust)

    Ctrl-C stops it as it stops `search`. Call it again to go on.

    Args:
        run: the run, or its directory.
        model: as in `search`; empty means the run's own.
        trust: use addresses, files and models that the run names, also those that you never used on this machine.
        on_event: as in `search`.
        settings: those of `eureka robust`, by the same names.

    Raises:
        ConfigError: for an unknown setting, one that does not fit, or a run without a policy.
        ModelError: when no reply holds ranges that can be used.
        EurekaError: for anything else that a person can mend; what was finished is kept.
    """
    if not isinstance(run, Run):
        _expect("run", run, "a run or the path of its directory")
    directory = run.directory if isinstance(run, Run) else whole_path(run)
    own, name = _named(model)
    typed = taken(RobustConfig, {"model": name, **settings})
    wanted = RobustConfig(**typed)
    config = wanted.applied_to(compose.stored(directory), typed)
    given = [key for key, value in typed.items() if value]
    agree(config, directory, typed=given, trusted=trust, way="call robust(..., trust=True)")
    words = [repr(str(short_path(directory))), *(f"{key}={value!r}" for key, value in typed.items() if key != "model")]
    if own is not None or name:
        words.append("model=..." if own is not None else f"model={name!r}")  # an object cannot be written as text
    again = f"openeureka.robust({', '.join(words)})"
    return done(directory, on_event, lambda host: compose.robust(wanted, config, directory, host, own, again=again))


def check(env: str | Path, program: str | Path, *, unsafe_no_sandbox: bool = False) -> Verdict:
    """The verdict on one reward, as `eureka check` gives it: whether it can train, and if not, why.

    Args:
        env: as in `search`; with another interpreter, `dmc:DOMAIN-TASK+python=PATH`.
        program: a path, or the program as a text of several lines or one `def`. Either may be a model's whole reply.
        unsafe_no_sandbox: run it in an unconfined child process where the kernel cannot confine it.

    Raises:
        ConfigError: for a program that is neither a path nor a text.
        TaskError: for a task that does not exist.
        RewardFileError: for a file that cannot be read.
        SandboxUnavailable: where the kernel cannot confine it, or the machine is too busy.
    """
    _expect("program", program, "a path or the text of a program")
    candidate = rewards.read(program)
    return rewards.judge(absolute("env", str(env)), [candidate], unsafe=unsafe_no_sandbox)[0]


def open_run(directory: str | Path) -> Run:
    """An existing run, finished, stopped or at work. Nothing that its settings name is used.

    Raises:
        ConfigError: for a directory that is no path.
        StoreError: when there is no run.
    """
    _expect("directory", directory, "the path of a run")
    run = Run(Path(directory))
    Store.view(run.directory).close()
    return run


def _searched(
    env: str | Path, model: str | LanguageModel, settings: Mapping[str, object]
) -> tuple[RunConfig, LanguageModel | None]:
    """The settings of a search, and the model where it is an object."""
    own, name = _named(model)
    typed = taken(RunConfig, {"env": env, "model": name, **settings})
    config = compose.admitted(RunConfig(**typed), typed)
    return config, own


def _named(model: str | LanguageModel) -> tuple[LanguageModel | None, str]:
    """The model where it is an object, and its name."""
    if isinstance(model, str):
        return None, model
    expect_model(model)
    return model, model.name


def _expect(key: str, value: object, wanted: str) -> None:
    if not isinstance(value, (str, PathLike)):
        raise ConfigError(f"`{key}={value!s:.80}` does not fit: `{key}` takes {wanted}.")
