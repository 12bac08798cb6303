"""`eureka train`: given rewards side by side, in a run that searches for nothing."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path

from .. import given
from ..config import RunConfig, parse, short_name
from ..errors import ConfigError, RewardFileError, WorkerError
from ..given import Given
from ..observer import Observers
from ..report import tables
from ..report.build import build
from ..report.text import columns
from ..report.verdict import verdict
from ..report.view import RunView
from ..reward.extract import in_file
from ..store import Store
from ..store.paths import output_directory
from ..tasks.registry import get
from ..text import plain
from ..types import Candidate, TrainingState, Usage, Verdict
from . import trust
from .live import view
from .log import logged
from .progress import working
from .rewards import explain, judge
from .settings import TrainConfig
from .show import facts
from .stop import continuable, stoppable
from .trainer import trainer_of

BUILT_IN = ("human", "sparse")


def train(words: Sequence[str], *, as_json: bool = False) -> None:
    """Train every reward with every seed, or go on with that where `dir=` holds it; print a table, leave a report.

    As JSON: what `eureka show --json` prints, and the directory; what people are told goes to stderr.
    """
    typed = parse(TrainConfig, words)
    get(typed.env)
    trust.remember(typed)
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        rewards = _given(typed)
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
    trainer = trainer_of(config, directory)
    print(f"{short_name(config.env)}: given rewards, in {directory}")
    with (
        Store.open(directory, config) as store,
        continuable(directory),
        stoppable(directory),
        logged(directory, config, Usage()) as log,
        view(config, Usage()) as table,
    ):
        if rewards is not None:
            given.keep(store, rewards)
        given.train(config, store, trainer, Observers(table, *log))
    with working("Writing the report"):
        problems = build(directory, config.video, config.env)
    run = RunView.read(directory)
    scores = tables.given(run)
    print(f"\n{columns([scores.titles, *scores.rows])}\n\n{scores.note}\n{plain(verdict(run))}")
    for job, result in run.results.items():
        if result.state is TrainingState.DIVERGED:
            print(plain(f"{job} {result.message}"))
    for problem in problems:
        print(plain(problem))
    print(f"\nEverything is in {directory}; begin with report.html")
    return run


def _given(config: TrainConfig) -> Given:
    """The rewards by what they are called, files by their stem; each is checked before anything of a run is made."""
    words = [word.strip() for word in config.reward.split(",") if word.strip()]
    if not words:
        raise ConfigError("`reward` names nothing to train, write for example reward=human,sparse.")
    files = {word: in_file(Path(word))[0] for word in words if word not in BUILT_IN}
    verdicts = judge(config.env, list(files.values()), worlds=config.worlds, unsafe=config.unsafe_no_sandbox)
    judged = dict(zip(files, verdicts, strict=True))
    rewards: dict[str, tuple[Candidate, Verdict] | None] = {}
    for word in words:
        name = word if word in BUILT_IN else _name(word)
        if name in rewards:
            raise ConfigError(f"`reward` names `{name}` twice; give the files different names.")
        if word in BUILT_IN:
            rewards[name] = None
        elif judged[word].accepted:
            rewards[name] = files[word], judged[word]
        else:
            raise RewardFileError(f"{word} was refused: {'; '.join(explain(judged[word]))}")
    return rewards


def _name(path: str) -> str:
    """A file's stem, as far as it can name a folder."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", Path(path).stem).lstrip("-")[:60] or "reward"


def _say_what_failed(run: RunView) -> None:
    failed = {job: result.message for job, result in run.results.items() if result.state is TrainingState.FAILED}
    if not failed:
        return
    reason = next(iter(failed.values()))
    if len(failed) == len(run.results):
        raise WorkerError(reason)
    raise WorkerError(f"{', '.join(failed)} could not be trained. {reason}")
