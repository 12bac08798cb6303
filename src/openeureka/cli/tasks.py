"""`eureka envs` and `eureka context`."""

from __future__ import annotations

import json
import shutil
import textwrap
from collections.abc import Sequence

from .. import baselines, prompts
from ..config import RunConfig, parse
from ..report.text import columns, number
from ..score import mean
from ..tasks import registry
from ..tasks.context import context as context_of
from ..tasks.context import informed
from ..tasks.record import record_states
from ..tasks.task import Task
from ..text import plain
from ..types import StateVar
from .settings import ContextConfig

INDENT = "    "


def envs(*, as_json: bool = False) -> None:
    """Print each task with its sizes and intent, suite by suite."""
    header = ("env", "obs", "act", "steps", "human F", "sparse F")
    tasks = {name: registry.get(name) for name in registry.names()}
    if as_json:
        print(json.dumps({name: _facts(name, task) for name, task in tasks.items()}, indent=2))
        return
    suites = list(dict.fromkeys(task.suite for task in tasks.values()))
    ordered = sorted(tasks.items(), key=lambda item: suites.index(item[1].suite))
    first, *lines = columns([header, *((name, *_row(task), *_baselines(name)) for name, task in ordered)]).splitlines()
    room = max(40, shutil.get_terminal_size().columns - len(INDENT))
    print(first)
    suite = ""
    for (_, task), line in zip(ordered, lines, strict=True):
        if task.suite != suite:
            suite = task.suite
            print(f"\n{suite}")
        print(line)
        print("\n".join(f"{INDENT}{part}" for part in textwrap.wrap(plain(task.description), room)))
    print("\nobs, act: sizes of observation and action. steps: of an episode.")
    print("F: held out, mean over seeds, where benchmarks/baselines.py has measured it.")
    print("More about one task: eureka context env=NAME")


def _facts(name: str, task: type[Task]) -> dict[str, object]:
    known = baselines.known(name)
    return {
        "suite": task.suite,
        "description": task.description,
        "observations": task.num_observations,
        "actions": task.num_actions,
        "episode_length": task.episode_length,
        "human_fitness": mean(known.human.held_out) if known else None,
        "sparse_fitness": mean(known.sparse.held_out) if known else None,
    }


def _row(task: type[Task]) -> tuple[str, ...]:
    return str(task.num_observations), str(task.num_actions), str(task.episode_length)


def _baselines(env: str) -> tuple[str, str]:
    known = baselines.known(env)
    return (number(mean(known.human.held_out)), number(mean(known.sparse.held_out))) if known else ("-", "-")


def context(words: Sequence[str]) -> None:
    """Print description, state table, facts and pruned source of a task."""
    env = parse(ContextConfig, words).env
    known = informed(context_of(env), record_states(env), RunConfig(env=env))
    table = columns([(variable.name, _type(variable), variable.meaning) for variable in known.state.variables])
    print("\n\n".join([f"Task: {known.description}", table, "\n".join(prompts.facts(known)), known.source]))


def _type(variable: StateVar) -> str:
    if variable.kind in ("world", "constant"):
        sizes = ("N", *variable.shape) if variable.kind == "world" else variable.shape
        return f"Tensor ({', '.join(map(str, sizes))})"
    return "int" if variable.kind == "num_envs" else variable.kind
