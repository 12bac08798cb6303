"""`eureka envs` and `eureka context`."""

from __future__ import annotations

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
from ..types import StateVar
from .settings import ContextConfig


def envs() -> None:
    """Print one line per task, suite by suite."""
    header = ("env", "suite", "observations", "actions", "episode", "human F", "sparse F", "description")
    tasks = {name: registry.get(name) for name in registry.names()}
    suites = list(dict.fromkeys(task.suite for task in tasks.values()))
    by_suite = sorted(tasks.items(), key=lambda item: suites.index(item[1].suite))
    rows = [(name, *_row(task), *_baselines(name), task.description) for name, task in by_suite]
    print(columns([header, *rows]))
    print("\nEpisode: in steps. F: held out, mean over seeds, where benchmarks/baselines.py has measured it.")


def _row(task: type[Task]) -> tuple[str, ...]:
    return (task.suite, *map(str, (task.num_observations, task.num_actions, task.episode_length)))


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
