"""`eureka export`: the best reward of a run, for the suite that its environment comes from."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import ConfigError
from ..parsing import parse
from ..report.view import RunView
from ..runs import trust
from ..store import artifacts
from ..tasks import registry
from .settings import ExportConfig, only_path, split

USAGE = "eureka export outputs/<time>_hopper_v5 to=gymnasium"


def export(words: Sequence[str]) -> None:
    """Write `best/reward_SUITE.py`, and say how it is used.

    Raises:
        ConfigError: when the run has no reward yet, or its environment comes from another suite.
        TaskError: when its environment cannot be made, or the reward reads what only openeureka computes.
    """
    settings, paths = split(words)
    config, directory = parse(ExportConfig, settings), only_path(paths, USAGE)
    run = RunView.read(directory)
    best = run.best
    if best is None or best.verdict is None or best.verdict.graph is None or best.candidate is None:
        raise ConfigError(f"{directory} has found no reward yet; `eureka show {directory}` says how far it is.")
    if not config.env and "env" in trust.unknown(run.config):
        raise ConfigError(
            f"{directory} was not started here, and its task {run.config.env} would be run; say env=... if you know it."
        )
    task = registry.get(config.env or run.config.env)
    text = task.handed_back(best.verdict.graph, best.candidate.source)  # refuses a task that is of no other program
    if config.to not in ("", task.suite):
        raise ConfigError(f"`{task.env}` comes from {task.suite}, so its rewards go to={task.suite}, not {config.to}.")
    name = f"best/reward_{task.suite}.py"
    artifacts.write(directory, name, text)
    print(f"Wrote {directory / name}. Its first lines say how it is used.")
