"""`eureka export`: the best reward of a run, for the suite of its environment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import ConfigError
from ..parsing import command_line, parse
from ..runs import trust
from ..store import Store, artifacts, expect_files, read_config
from ..tasks import registry
from ..types import Candidate, RewardGraph
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
    began = read_config(directory)
    source, graph = _best(directory)
    if not config.env:
        trust.expect_known(began.env, str(directory), "add env=...")
    task = registry.get(config.env or began.env)
    text = task.handed_back(graph, source)  # raises for openeureka's own tasks
    if config.to not in ("", task.suite):
        raise ConfigError(f"`{task.env}` comes from {task.suite}, so use to={task.suite}, not to={config.to}.")
    name = f"best/reward_{task.suite}.py"
    artifacts.write(directory, name, text)
    print(f"Wrote {directory / name}. Its first lines say how to use it.")


def _best(directory: Path) -> tuple[str, RewardGraph]:
    """The reward in `best/`, with fitted numbers where it has some: its text and its accepted graph."""
    source = (artifacts.read(directory, "best/reward.py") or b"").decode(errors="replace")
    with Store.view(directory) as store:
        verdict = store.rewards.verdict(Candidate.of(source).id)
        if not source:
            expect_files(store)
    if not source and artifacts.read(directory, "best/policy.safetensors") is not None:
        raise ConfigError(f"The best reward of {directory} came with the task, so there is nothing to export.")
    if verdict is None or verdict.graph is None:
        raise ConfigError(f"{directory} has no reward yet; `{command_line('show', directory)}` shows how far it is.")
    return source, verdict.graph
