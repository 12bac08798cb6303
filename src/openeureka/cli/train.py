"""`eureka run`, `resume`, `train`, `tune`, `robust` and `bench`: all that trains, with the terminal as its host."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from ..benchmark import bench as cells
from ..config import NO_MODEL, RobustConfig, RunConfig, TrainConfig, TuneConfig
from ..errors import WorkerError
from ..method.given import Given
from ..method.seeds import unused_seed
from ..numbers import columns
from ..parsing import changed, command_line, parse, short_path, whole_path
from ..report.next_steps import deciding
from ..report.view import RunView
from ..runs import compose, trust
from ..runs.rewards import left_out, listed, named, to_tune
from ..runs.run import Run
from ..store.directory import expect_free, output_directory
from ..text import plain
from ..types import Candidate, TrainingState, Verdict
from .facts import written
from .settings import BenchConfig, only_path, split, trusting
from .show import given_lines, robust_lines, summary, tell, tuned
from .terminal import Terminal, aside


def run(words: Sequence[str]) -> None:
    """Start a search, or continue the one that `dir=` holds."""
    config = compose.admitted(parse(RunConfig, words), _keys(words))
    directory = output_directory(config.dir, config.env)
    _tell(directory, compose.search(config, directory, Terminal()))


def resume(words: Sequence[str]) -> None:
    """Continue a run; settings that do not change what is searched may be given anew.

    A person first agrees to what the stored settings reach outside the run, see `trust`.
    """
    settings, paths = split(words)
    directory = whole_path(only_path(paths, "eureka resume outputs/<time>_cartpole"))
    settings, trusted = trusting(settings, directory)
    stored = compose.stored(directory)
    config = changed(stored, settings)
    expect_free(directory, config)
    trust.agree(config, directory, typed=_keys(settings), trusted=trusted, way=_trusting(directory), asks=True)
    if config.model == NO_MODEL and config.tune:
        _say_that_all_failed(fit(config, directory, None))
    elif config.model == NO_MODEL:
        _say_what_failed(compare(config, directory, None))
    else:
        _tell(directory, compose.search(config, directory, Terminal(_to_improve(config, directory))))


def _to_improve(config: RunConfig, directory: Path) -> str:
    """How to go on from what a finished search has found; empty where it found nothing, or is not finished."""
    best = directory / "best" / "reward.py"
    if not (Run(directory).finished and best.is_file()):
        return ""
    return (
        f"{short_path(directory)} is finished; its result is below. To improve on it, start a new search from its best "
        f"reward:\n  {_next_search(config, best)}"
    )


def _next_search(config: RunConfig, best: Path) -> str:
    """The command for the same search, beginning with the reward that this one found. It omits what belongs to one run.

    It has an unused seed: with the seeds that chose the reward, the same trainings would choose it again.
    """
    own = {"env", "init", "seed", "dir", "unsafe_no_sandbox"}
    kept = {
        field.name: value
        for field in dataclasses.fields(config)
        if field.name not in own and (value := getattr(config, field.name)) != field.default
    }
    settings = {"env": config.env, "init": short_path(best), "seed": unused_seed(config), **kept}
    return command_line("run", *(f"{key}={value}" for key, value in settings.items()))


def _trusting(directory: Path) -> str:
    """How to agree beforehand to what a run from elsewhere uses."""
    return f"add {shlex.quote(f'trust={short_path(directory)}')}"


def _keys(words: Sequence[str]) -> set[str]:
    return {word.partition("=")[0] for word in words}


def _tell(directory: Path, problems: Sequence[str]) -> None:
    """Print what the search found, and what of its report could not be made."""
    result = RunView.read(directory)
    if (best := result.best_text) is not None:
        print(f"\nBest reward:\n\n{plain(best.source)}")
    tell(summary(result))
    _close(result, directory, problems)


def _close(run: RunView, directory: Path, problems: Sequence[str]) -> None:
    """Print what of the report could not be made, where the rest is, and the command to decide what is open."""
    for problem in problems:
        print(plain(problem))
    shown = short_path(directory)
    print(f"\nEverything is in {shown}; begin with report.html")
    for command, _ in deciding(run, str(shown)):
        print(f"To decide what is open: {plain(command)}")


def train(words: Sequence[str], *, as_json: bool = False) -> None:
    """Train every reward with every seed, or go on with that where `dir=` holds it; print a table, leave a report.

    As JSON: what `eureka show --json` prints, and the directory; what people are told goes to stderr.
    """
    typed = parse(TrainConfig, words)
    with aside() if as_json else nullcontext():
        config = compose.comparison(typed)
        rewards = named(typed, listed(typed.reward))
        directory = output_directory(typed.dir, typed.env, "train_")
        run = compare(config, directory, rewards)
    if as_json:
        print(written(run, directory))
    _say_what_failed(run)


def compare(config: RunConfig, directory: Path, rewards: Given | None) -> RunView:
    """Train what is missing, write the report and print the scores.

    Args:
        rewards: None for those that the run holds.
    """
    problems = compose.train(config, directory, rewards, Terminal())
    run = RunView.read(directory)
    tell(["", *given_lines(run)])
    for lane, result in run.results.items():
        if result.state is TrainingState.DIVERGED:
            print(plain(f"{lane} {result.message}"))
    _close(run, directory, problems)
    return run


def _failed(run: RunView) -> dict[str, str]:
    """What the trainer said of lanes that ended their worker, by id."""
    return {lane: result.message for lane, result in run.results.items() if result.state is TrainingState.FAILED}


def _say_that_all_failed(run: RunView) -> None:
    failed = _failed(run)
    if failed and len(failed) == len(run.results):
        raise WorkerError(next(iter(failed.values())))


def _say_what_failed(run: RunView) -> None:
    _say_that_all_failed(run)
    if failed := _failed(run):
        raise WorkerError(f"{', '.join(failed)} could not be trained. {next(iter(failed.values()))}")


def tune(words: Sequence[str], *, as_json: bool = False) -> None:
    """Fit the numbers of a reward, or go on with that where `dir=` holds it; print tables, leave a report.

    As JSON: what `eureka show --json` prints, and the directory; what people are told goes to stderr.
    """
    typed = parse(TuneConfig, words)
    with aside() if as_json else nullcontext():
        config = compose.comparison(typed)
        reward = to_tune(typed, typed.reward)
        advice = left_out(typed, typed.reward)
        directory = output_directory(typed.dir, typed.env, "tune_")
        run = fit(config, directory, reward, advice)
    if as_json:
        print(written(run, directory))
    _say_that_all_failed(run)


def fit(config: RunConfig, directory: Path, reward: tuple[Candidate, Verdict] | None, advice: str = "") -> RunView:
    """Fit what is missing, write the report and print what was found.

    Args:
        reward: None for that of the run.
        advice: printed when the work begins.
    """
    problems = compose.tune(config, directory, reward, Terminal(advice))
    run = RunView.read(directory)
    tell(["", *tuned(run)])
    _close(run, directory, problems)
    return run


def robust(words: Sequence[str]) -> None:
    """Do what is missing to make the best policy of a run robust, write the report and print what was found."""
    settings, paths = split(words)
    directory = whole_path(only_path(paths, "eureka robust outputs/<time>_anymal"))
    settings, trusted = trusting(settings, directory)
    typed = _keys(settings)
    wanted = parse(RobustConfig, settings)
    config = wanted.applied_to(compose.stored(directory), typed)
    trust.agree(config, directory, typed=typed, trusted=trusted, way=_trusting(directory), asks=True)
    again = command_line("robust", directory, *settings)
    problems = compose.robust(wanted, config, directory, Terminal(), again=again)
    found = RunView.read(directory).robust
    if found is not None:
        tell(["", *robust_lines(found)])
    for problem in problems:
        print(plain(problem))
    print(f"\nThe policy and its ranges are in {short_path(directory / 'robust')}; begin with report.html")


class _Host(Terminal):
    """A terminal whose searches are resumed by running the bench again."""

    def __init__(self, command: str) -> None:
        super().__init__()
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
    plan, directory = cells.opened(path, parse(BenchConfig, settings).dir)
    told: list[cells.Bench] = []
    host = _Host(command_line("bench", path, *settings))
    cells.run(plan, directory, host, tell=told.append, say=lambda text: print(plain(text), flush=True))
    _tell_compared(told[-1])
    return next((error.exit_code for error in told[-1].failures.values()), 0)


def _tell_compared(found: cells.Bench) -> None:
    for table in found.compared.tables():
        print(plain(f"\n{columns([table.titles, *table.rows])}\n\n{table.note}"))
    for name, error in found.failures.items():
        print(plain(f"{name} could not be finished: {error}"))
    print(f"\nEverything is in {short_path(found.directory)}; begin with {cells.PAGE}")
