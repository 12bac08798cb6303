"""Plans of `eureka bench`: tasks, seeds, and arms that differ in their settings. Read strictly from YAML."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from ..config import NO_MODEL, RunConfig, short_name
from ..errors import ConfigError, nearest
from ..method.seeds import unused_seed
from ..parsing import absolute, parse, plain_number, read_yaml, taken

Settings = Mapping[str, Any]
"""Values of `RunConfig` fields by name."""

NAME = re.compile(r"\w{1,40}", re.ASCII)
OWN = ("env", "seed", "dir")
"""Settings that an arm may not choose: every cell has its own."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One search of a plan: a task, an arm and a seed."""

    task: str
    arm: str
    seed: int

    @property
    def name(self) -> str:
        """Name of its directory, which people see too."""
        return f"{short_name(self.task)}-{self.arm}-{self.seed}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Arms x tasks x seeds. Raises ConfigError, in one sentence, for what does not fit."""

    tasks: tuple[str, ...]
    seeds: tuple[int, ...]
    arms: Mapping[str, Settings]
    """What each arm changes; the others are compared with the first."""
    settings: Settings = field(default_factory=dict[str, Any])
    """Settings of all arms."""
    per_task: Mapping[str, Settings] = field(default_factory=dict[str, Settings])
    """What a task changes of these; an arm's own settings override both."""

    def __post_init__(self) -> None:
        _listed("tasks", self.tasks, str)
        object.__setattr__(self, "seeds", tuple(_listed("seeds", self.seeds, int)))  # may be NumPy's integers
        for where, named in (("arms", self.arms), ("per_task", self.per_task)):
            for name, settings in _expect_named(where, named).items():
                _expect_settings(f"{where}.{name}", settings)
        _expect_settings("settings", self.settings)
        for what, values in (("tasks", self.tasks), ("seeds", self.seeds), ("arms", self.arms)):
            if not values:
                raise ConfigError(f"The plan has no {what}.")
        for what, named in (("task", [*map(short_name, self.tasks)]), ("seed", [*map(str, self.seeds)])):
            if twice := [value for value in named if named.count(value) > 1]:
                raise ConfigError(f"The plan names the {what} {twice[0]} twice.")
        for arm in self.arms:
            if not NAME.fullmatch(arm):
                raise ConfigError(f"An arm's name has letters, digits and `_` only, at most 40, not `{arm:.60}`.")
        if unknown := [task for task in self.per_task if task not in self.tasks]:
            raise ConfigError(
                f"`per_task` names `{unknown[0]}`, which is not a task of the plan.{nearest(unknown[0], self.tasks)}"
            )
        reach = max(unused_seed(self.config(cell)) - cell.seed for cell in self.cells())
        for one, other in pairwise(sorted(self.seeds)):
            if other - one < reach:
                raise ConfigError(
                    f"The seeds {one} and {other} are too close: a search with seed {one} uses seeds up to "
                    f"{one + reach - 1}, so both would share trainings. Choose seeds at least {reach} apart."
                )

    def cells(self) -> Iterator[Cell]:
        """The cells in the order in which they run: a bench that is stopped early has every arm of the first seeds."""
        for seed in self.seeds:
            for task in self.tasks:
                for arm in self.arms:
                    yield Cell(task, arm, seed)

    def typed(self, cell: Cell) -> dict[str, Any]:
        """The settings of a cell that the plan names."""
        chosen = {**self.settings, **self.per_task.get(cell.task, {}), **self.arms[cell.arm]}
        return {**chosen, "env": cell.task, "seed": cell.seed}

    def config(self, cell: Cell) -> RunConfig:
        """All settings of a cell except its directory."""
        try:
            return RunConfig(**taken(RunConfig, self.typed(cell)))
        except ConfigError as error:
            raise ConfigError(f"In the cell {cell.name}: {error}") from None


# --- from YAML, or from Python ---------------------------------------------------------------------------------------


class _Loader(yaml.SafeLoader):
    """Refuses repeated keys, and integers that begin with a zero, which YAML takes for octal."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        named = [key for key, _ in node.value if key.tag != "tag:yaml.org,2002:merge"]
        keys = [self.construct_object(key, deep=True) for key in named]
        if twice := [key for key in keys if keys.count(key) > 1]:
            raise yaml.constructor.ConstructorError(None, None, f"`{twice[0]}` appears twice", node.start_mark)
        return super().construct_mapping(node, deep)

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        number = super().construct_yaml_int(node)
        if re.fullmatch(r"[-+]?0[0-9_]+", node.value):
            says = f"`{node.value}` means {number} in YAML: leave out the leading zero"
            raise yaml.constructor.ConstructorError(None, None, says, node.start_mark)
        return number


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)


def load(path: Path) -> Plan:
    """A plan from a YAML file; paths in it are relative to the file's folder. Raises ConfigError."""
    found = read_yaml(path, "plan", _Loader)
    try:
        return plan(found, path.parent)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def plan(found: object, folder: Path | None = None) -> Plan:
    """A plan from the contents of a YAML file.

    Args:
        folder: folder that paths in the plan are relative to; None for the working directory.

    Raises:
        ConfigError: for what does not fit.
    """
    folder = folder or Path()
    if not isinstance(found, Mapping):
        raise ConfigError("A plan must be a mapping with `tasks`, `seeds` and `arms`.")
    readers: dict[str, Callable[[str, object], Any]] = {
        "tasks": lambda key, value: tuple(absolute("env", task, folder) for task in _listed(key, value, str)),
        "seeds": lambda key, value: tuple(_listed(key, value, int)),
        "arms": lambda key, value: _named(key, value, folder),
        "settings": lambda key, value: _settings(key, value, folder),
        "per_task": lambda key, value: {
            absolute("env", task, folder): changes for task, changes in _named(key, value, folder).items()
        },
    }
    for key in found:
        if key not in readers:
            raise ConfigError(f"A plan has no `{key}`.{nearest(str(key), readers)} It takes {', '.join(readers)}.")
    if missing := [key for key in ("tasks", "seeds", "arms") if key not in found]:
        raise ConfigError(f"The plan has no {missing[0]}.")
    return Plan(**{str(key): readers[key](key, value) for key, value in found.items()})


def _listed(key: str, value: object, kind: type) -> list[Any]:
    items = [plain_number(item) for item in value] if isinstance(value, (list, tuple, range)) else None
    if items is None or any(type(item) is not kind for item in items):
        wanted = "names" if kind is str else "whole numbers"
        raise ConfigError(f"`{key}` must be a list of {wanted}, not `{value!s:.60}`.")
    if kind is int and any(item < 0 for item in items):
        raise ConfigError(f"`{key}` must be zero or more.")
    return items


def _expect_named(key: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"`{key}` must be a mapping of names to settings, such as `{{short: {{steps: 10000}}}}`.")
    if other := [name for name in value if type(name) is not str]:
        raise ConfigError(f"`{key}` has the name `{other[0]!s:.60}`, which is not text; put it in quotes.")
    return value


def _expect_settings(where: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"`{where}` must be a mapping of settings, such as `{{sample: 8}}`, not `{value!s:.60}`.")
    if own := [key for key in OWN if key in value]:
        raise ConfigError(f"`{where}` sets `{own[0]}`, which the plan sets for each cell; leave it out.")
    return value


def _named(key: str, value: object, folder: Path) -> dict[str, Settings]:
    """Settings by name, such as those of arms."""
    named = _expect_named(key, value)
    return {name: _settings(f"{key}.{name}", changes, folder) for name, changes in named.items()}


def _settings(where: str, value: object, folder: Path) -> Settings:
    """Settings as the command line reads them."""
    if value is None:
        return {}
    value, words = _expect_settings(where, value), list[str]()
    for key, given in value.items():
        given = plain_number(given)
        if not isinstance(given, (str, int, float, Path)):
            raise ConfigError(f"`{where}` sets `{key}` to `{given!s:.60}`; a setting takes a text or a number.")
        text = f"{given:.0f}" if isinstance(given, float) and given.is_integer() else str(given)
        words.append(f"{key}={absolute(str(key), text, folder)}")
    try:
        read = parse(RunConfig, words)
    except ConfigError as error:
        raise ConfigError(f"In `{where}`: {error}") from None
    if "model" in value and read.model == NO_MODEL:
        raise ConfigError(f"`{where}` sets model={NO_MODEL}, but a bench compares searches.")
    return {str(key): getattr(read, str(key)) for key in value}
