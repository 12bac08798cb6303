"""`eureka train`: given rewards as lanes of one population."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from pathlib import Path

from .. import baselines
from ..config import as_dict, parse
from ..errors import ConfigError, Interrupted, RewardFileError, WorkerError
from ..llm.extract import in_file
from ..report import build, events, tables, trained
from ..report.tables import Table
from ..report.text import columns, duration, number, spread
from ..score import human_normalised, mean, rank
from ..store import artifacts
from ..store.codec import finite
from ..store.paths import output_directory
from ..tasks.registry import get
from ..text import plain
from ..types import (
    Evaluation,
    RewardProgram,
    TrainBudget,
    Trainer,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    TrainJob,
)
from . import trust
from .progress import ProgressLine, working
from .rewards import explain, judge
from .settings import TrainConfig
from .stop import announced
from .trainer import trainer_of

BUILT_IN = ("human", "sparse")


def train(words: Sequence[str], *, as_json: bool = False) -> None:
    """Train every reward with every seed at once, print a table and leave curves and policies.

    As JSON: what `result.json` holds, and the directory; what people are told goes to stderr.
    """
    config = parse(TrainConfig, words)
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        directory, found, failed = _compared(config)
    if as_json:
        print(json.dumps({"directory": str(directory), **found}, indent=2))
    if failed:
        raise WorkerError(failed)


def _compared(config: TrainConfig) -> tuple[Path, dict[str, object], str]:
    """The directory, what `result.json` there holds, and a word on trainings that failed beside others."""
    get(config.env)
    trust.remember(config)
    programs = _programs(config)
    seeds = range(config.seed, config.seed + config.seeds)
    jobs = {f"{name}-s{seed}": TrainJob(id=f"{name}-s{seed}", program=programs[name], seed=seed)
            for name in programs for seed in seeds}  # fmt: skip
    directory = output_directory(config.dir, config.env, "train_")
    trainer = trainer_of(config, directory, lanes=".")
    try:
        with announced():
            results = _train(trainer, config, list(jobs.values()), directory)
    except KeyboardInterrupt:
        kept = "" if config.curriculum else f" What is under way is kept: say the same with dir={directory} to go on."
        raise Interrupted(f"Stopped.{kept}") from None
    failed = {job: result.message for job, result in results.items() if result.state is TrainingState.FAILED}
    if len(failed) == len(results):
        raise WorkerError(next(iter(failed.values())))
    policies = {job: result.best_fitness.policy for job, result in results.items() if result.best_fitness}
    with working("Scoring on held-out episodes"):
        held_out = {score.job: score for score in trainer.evaluate(config.env, policies, seed=config.seed)}
    found = _save(directory, config, results, held_out)
    lanes = {name: [f"{name}-s{seed}" for seed in seeds] for name in programs}
    scores = _scores(config.env, lanes, results, held_out)
    artifacts.write(directory, "report.html", trained.report(config.env, scores, tables.settings(config), results))
    print(f"{columns([scores.titles, *scores.rows])}\n\n{scores.note}")
    if problem := _save_best(directory, policies, held_out):
        print(problem)
    for job, result in results.items():
        if result.state is TrainingState.DIVERGED:
            print(plain(f"{job} {result.message}"))
    print(f"\nCurves and policies are in {directory}; begin with report.html")
    lost = f"{', '.join(failed)} could not be trained. {next(iter(failed.values()))}" if failed else ""
    return directory, found, lost


def _programs(config: TrainConfig) -> dict[str, RewardProgram]:
    """Label -> program: reward files are checked first and named by their stem."""
    names = [name.strip() for name in config.reward.split(",") if name.strip()]
    if not names:
        raise ConfigError("`reward` names nothing to train, write for example reward=human,sparse.")
    files = {name: in_file(Path(name))[0] for name in names if name not in BUILT_IN}
    verdicts = judge(config.env, list(files.values()), worlds=config.worlds, unsafe=config.unsafe_no_sandbox)
    checked = dict(zip(files, verdicts, strict=True))
    programs: dict[str, RewardProgram] = {}
    for name in names:
        label = name if name in BUILT_IN else Path(name).stem
        if label in programs:
            raise ConfigError(f"`reward` names `{label}` twice; give the files different names.")
        if name == "human" or name == "sparse":
            programs[label] = name
        elif (graph := checked[name].graph) is not None:
            programs[label] = graph
        else:
            raise RewardFileError(f"{name} was refused: {'; '.join(explain(checked[name]))}")
    return programs


def _train(
    trainer: Trainer, config: TrainConfig, jobs: Sequence[TrainJob], directory: Path
) -> dict[str, TrainingResult]:
    """Results by job; policies and curves of each are written as soon as it is there."""
    results: dict[str, TrainingResult] = {}
    budget = TrainBudget(env_steps=config.steps, worlds=config.worlds, bonus=config.bonus == "original")
    with ProgressLine() as line:
        for report in trainer.train(config.env, jobs, budget):
            if isinstance(report, TrainingProgress):
                line.show(report)
                continue
            results[report.job] = report
            artifacts.write(directory, f"{report.job}/{events.FILE_NAME}", events.of(report))
            if report.best_fitness is not None:
                artifacts.write(directory, f"{report.job}/policy.safetensors", report.best_fitness.policy)
    return results


def _save(
    directory: Path, config: TrainConfig, results: Mapping[str, TrainingResult], held_out: Mapping[str, Evaluation]
) -> dict[str, object]:
    """Write the curves and `result.json`; returns what that holds."""
    curves = {job: result.curves for job, result in results.items()}
    artifacts.write(directory, "curves.json", json.dumps(curves))
    jobs = {
        job: {
            "state": result.state,
            "fitness": finite(result.fitness),
            "held_out_fitness": finite(held_out[job].fitness) if job in held_out else None,
            "held_out_episode_length": held_out[job].episode_length if job in held_out else None,
            "correlation_with_human": finite(result.correlation),
            "env_steps": result.env_steps,
            "seconds": result.seconds,
            "message": result.message,
        }
        for job, result in results.items()
    }
    found: dict[str, object] = {"config": as_dict(config), "jobs": jobs}
    artifacts.write(directory, "result.json", json.dumps(found, indent=2))
    return found


def _save_best(directory: Path, policies: Mapping[str, bytes], held_out: Mapping[str, Evaluation]) -> str:
    """Fill `best/` with the policy of highest held-out F. Returns why a file of it could not be made, or nothing."""
    if not held_out:
        return ""
    job = max(held_out, key=lambda job: rank(held_out[job].fitness))
    artifacts.write(directory, "best/policy.safetensors", policies[job])
    return build.best(directory, wanted="none", env="")


def _scores(
    env: str,
    lanes: Mapping[str, Sequence[str]],
    results: Mapping[str, TrainingResult],
    held_out: Mapping[str, Evaluation],
) -> Table:
    """A row for each reward; `lanes` are its jobs."""
    scores = {name: [held_out[job].fitness for job in jobs if job in held_out] for name, jobs in lanes.items()}
    scale, note = _scale(env, scores)
    rows = [
        (*_row(name, jobs, results, held_out), number(human_normalised(mean(scores[name]), *scale)))
        for name, jobs in lanes.items()
    ]
    titles = ("reward", "F", "held-out F", "episode length", "correlation", "steps", "time", "score")
    return Table(titles, rows, note)


def _scale(env: str, scores: Mapping[str, Sequence[float | None]]) -> tuple[tuple[float | None, float | None], str]:
    """Held-out F of the human and the sparse reward, trained along or known beforehand, and a word on which."""
    text = "Score: human-normalised, (F - sparse) / |human - sparse|, held out."
    if "human" in scores and "sparse" in scores:
        return (mean(scores["human"]), mean(scores["sparse"])), text
    known = baselines.known(env)
    if known is None:
        return (None, None), f"{text} It needs both: add human and sparse to reward=."
    return (mean(known.human.held_out), mean(known.sparse.held_out)), f"{text} {known.sentence()}"


def _row(
    name: str, jobs: Sequence[str], results: Mapping[str, TrainingResult], held_out: Mapping[str, Evaluation]
) -> tuple[str, ...]:
    done = [results[job] for job in jobs]
    scores = [held_out[job] for job in jobs if job in held_out]
    return (
        name,
        spread([result.fitness for result in done]),
        spread([score.fitness for score in scores]),
        spread([score.episode_length for score in scores]),
        spread([result.correlation for result in done]),
        str(sum(result.env_steps for result in done)),
        duration(max(result.seconds for result in done)),
    )
