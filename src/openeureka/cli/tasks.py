"""`eureka envs`, `context` and `check`: tasks, and rewards for them, before anything trains."""

from __future__ import annotations

import dataclasses
import json
import shutil
import textwrap
from collections.abc import Sequence

from ..config import RunConfig
from ..errors import ConfigError, TaskError
from ..method import baselines, prompts
from ..numbers import columns, number
from ..parsing import parse
from ..reward.extract import in_file
from ..runs.rewards import explain, judge, meaning
from ..stats import mean
from ..tasks import registry
from ..tasks.context import context as context_of
from ..tasks.context import informed
from ..tasks.record import record_states
from ..tasks.task import Task
from ..text import plain
from ..types import StateVar
from .settings import CheckConfig, ContextConfig, only_path, split
from .terminal import trying_out

INDENT = "    "


def envs(*, as_json: bool = False) -> None:
    """Print each task with its sizes and intent, suite by suite."""
    header = ("env", "obs", "act", "episode", "human F", "sparse F")
    tasks = {name: registry.get(name) for name in registry.names()}
    if as_json:
        print(json.dumps({name: _facts(name, task) for name, task in tasks.items()}, indent=2))
        return
    suites = list(dict.fromkeys(task.suite for task in tasks.values()))
    ordered = sorted(tasks.items(), key=lambda item: suites.index(item[1].suite))
    rows = [(name, *_row(task), *map(number, _baselines(name))) for name, task in ordered]
    first, *lines = columns([header, *rows]).splitlines()
    room = max(40, shutil.get_terminal_size().columns - len(INDENT))
    print(first)
    suite = ""
    for (_, task), line in zip(ordered, lines, strict=True):
        if task.suite != suite:
            suite = task.suite
            print(f"\n{suite}")
        print(line)
        print("\n".join(f"{INDENT}{part}" for part in textwrap.wrap(plain(task.description), room)))
    print("\nobs, act: sizes of observation and action. episode: its maximum length in steps.")
    print("F: held out, mean over seeds, where benchmarks/baselines.py has measured it.")
    print("Policies are those at the peak of F or of their reward, whichever play better.")
    print("Any Gymnasium environment is a task too: env=gym:CartPole-v1")
    print("More about one task: eureka context env=NAME")


def _facts(name: str, task: type[Task]) -> dict[str, object]:
    human, sparse = _baselines(name)
    return {
        "suite": task.suite,
        "description": task.description,
        "observations": task.num_observations,
        "actions": task.num_actions,
        "episode_length": task.episode_length,
        "human_fitness": human,
        "sparse_fitness": sparse,
    }


def _row(task: type[Task]) -> tuple[str, ...]:
    return str(task.num_observations), str(task.num_actions), str(task.episode_length)


def _baselines(env: str) -> tuple[float | None, float | None]:
    """F of the human and of the sparse reward, as scores take it; None where it was not measured."""
    known = baselines.known(env, played=True)
    return (mean(known.human.held_out), mean(known.sparse.held_out)) if known else (None, None)


def context(words: Sequence[str]) -> None:
    """Print description, state table, facts and pruned source of a task."""
    env = parse(ContextConfig, words).env
    with trying_out():
        try:
            recorded = record_states(env)
        except TaskError as fault:  # F is not written yet: whoever writes it needs to see the state
            recorded = record_states(env, scored=False)
            print(fault)
        known = informed(context_of(env), recorded, RunConfig(env=env))
    table = columns([(variable.name, _type(variable), variable.meaning) for variable in known.state.variables])
    print("\n\n".join([f"Task: {known.description}", table, "\n".join(prompts.facts(known)), known.source]))


def _type(variable: StateVar) -> str:
    if variable.kind in ("world", "constant"):
        sizes = ("N", *variable.shape) if variable.kind == "world" else variable.shape
        return f"Tensor ({', '.join(map(str, sizes))})"
    return "int" if variable.kind == "num_envs" else variable.kind


def check(words: Sequence[str], *, as_json: bool = False) -> int:
    """Print the verdict on one reward file; returns 1 when it was refused."""
    settings, paths = split(words)
    usage = "eureka check env=cartpole my_reward.py"
    if any(word.startswith("reward=") for word in settings):
        raise ConfigError(f"Name the file without reward=, for example: {usage}")
    config = parse(CheckConfig, settings)
    path = only_path(paths, usage)
    candidate, note = in_file(path)
    with trying_out():
        (verdict,) = judge(config.env, [candidate], unsafe=config.unsafe_no_sandbox)
    if as_json:
        findings = [dataclasses.asdict(finding) for finding in verdict.findings]
        components = [name for name, _ in verdict.graph.components] if verdict.graph is not None else []
        print(json.dumps({"verdict": verdict.code, "findings": findings, "components": components}, indent=2))
        return 0 if verdict.accepted else 1
    head = f"{path}: {verdict.code} ({meaning(verdict)})"
    print("\n".join((*([note] if note else []), head, *explain(verdict, candidate.source))))
    return 0 if verdict.accepted else 1
