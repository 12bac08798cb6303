"""Runs the cells of a plan one after the other, and reports the comparison after each."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..config import RunConfig
from ..errors import ConfigError, EurekaError, Interrupted, StoreError
from ..executors.ray_node import versions
from ..parsing import short_path, whole_path
from ..report import html
from ..report.build import build
from ..runs import compose, program
from ..runs.stopping import stopped
from ..store import artifacts, read_config
from ..store.directory import OUTPUTS
from ..store.store import expect_same
from ..tasks.registry import get
from . import figures
from .plan import Cell, Plan, load, plan
from .table import Comparison, Row, Total

JSON = "bench.json"
PAGE = "bench.html"


@dataclass(frozen=True, slots=True)
class Bench:
    """A bench with its results so far, as `bench.json` and `bench.html` hold them."""

    directory: Path
    """Directory of the bench; each cell is a run below it, `<task>-<arm>-<seed>`."""
    compared: Comparison
    failures: Mapping[str, EurekaError] = field(default_factory=dict[str, EurekaError])
    """Why a cell could not be finished this time, by the cell's name."""
    begun: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Mapping[str, Any]])
    """By the name of a cell: date, device and versions at the beginning of the call that ran it last. A cell is missing
    if an older version ran it, which did not write them down."""

    @property
    def plan(self) -> Plan:
        """Its tasks, arms, seeds and settings."""
        return self.compared.plan

    @property
    def finished(self) -> bool:
        """Whether every cell is finished; if not, the same call goes on."""
        return len(self.compared.results) == sum(1 for _ in self.plan.cells())

    @property
    def rows(self) -> tuple[Row, ...]:
        """A row for each task and arm."""
        return self.compared.rows

    @property
    def totals(self) -> tuple[Total, ...]:
        """A row for each arm, over all tasks."""
        return self.compared.totals

    @property
    def results(self) -> tuple[figures.Result, ...]:
        """Every finished cell in numbers."""
        return self.compared.results

    def write(self) -> None:
        """Write the page and the rows anew."""
        facts = {
            "finished": self.finished,
            "rows": [asdict(row) for row in self.rows],
            "totals": [asdict(row) for row in self.totals],
            "cells": [asdict(result) for result in self.results],
            "failed": {name: str(error) for name, error in self.failures.items()},
            "plan": asdict(self.plan),
            "begun": self.begun,
        }
        artifacts.write(self.directory, JSON, json.dumps(facts, indent=1, default=str) + "\n")
        template = html.environment().get_template("bench.html")
        artifacts.write(self.directory, PAGE, template.render(bench=self, run=None, best=None))


def bench(
    plan: str | Path | Mapping[str, Any] | Plan, *, dir: str | Path = "", on_event: program.Tell | None = None
) -> Bench:
    """Search with every arm of a plan on every task with every seed, as `eureka bench` does, and compare the arms.

        bench = openeureka.bench("plan.yaml")
        print([(row.task, row.arm, row.held_out) for row in bench.rows])

    Finished cells are read, not run again: a call with the same `dir` goes on. A cell that cannot be finished is in
    `failures`, and the others go on. Ctrl-C stops the bench, and what is there so far is returned.

    Args:
        plan: a YAML file, a mapping such as one holds, or a `Plan`.
        dir: directory of the bench; empty means `outputs/bench_<name of the file>`, or `outputs/bench` without a file.
        on_event: called with every `Event` of every search; `Started` says which one begins.

    Raises:
        ConfigError: for a plan that does not fit.
        StoreError: where a cell in `dir` began with other settings.
    """
    read, directory = opened(plan, dir)
    found: list[Bench] = []
    try:
        run(read, directory, program.host(on_event), tell=found.append)
    except Interrupted:
        if not found:
            raise KeyboardInterrupt from None
        print(stopped(f"openeureka.bench(..., dir={str(short_path(directory))!r})"))
    return found[-1]


def opened(plan_: str | Path | Mapping[str, Any] | Plan, dir: str | Path = "") -> tuple[Plan, Path]:
    """A plan, and the directory of its bench. Raises ConfigError."""
    if isinstance(plan_, (str, Path)):
        path = Path(os.path.expanduser(plan_))
        return load(path), whole_path(dir or OUTPUTS / f"bench_{path.stem}")
    read = plan_ if isinstance(plan_, Plan) else plan(plan_)
    return read, whole_path(dir or OUTPUTS / "bench")


def run(
    plan: Plan,
    directory: Path,
    host: compose.Host,
    tell: Callable[[Bench], object],
    say: Callable[[str], object] = lambda text: None,
) -> None:
    """Run the missing cells. All that a person can get wrong about settings is refused before anything is made.

    Args:
        host: host of every search.
        tell: called with the bench as it stands: before the first cell, and after each.
        say: called with sentences on the progress.

    Raises:
        Interrupted: stopped by Ctrl-C; what was finished is kept.
        EurekaError: for a plan that does not fit; an error of a single cell is in `Bench.failures`.
    """
    for task in plan.tasks:
        get(task)
    configs = {cell: compose.admitted(plan.config(cell), plan.typed(cell)) for cell in plan.cells()}
    _expect_room(directory)
    _expect_as_begun(directory, configs)
    failures: dict[str, EurekaError] = {}
    results = {cell: _read(cell, directory / cell.name, failures) for cell in configs}
    for cell, config in configs.items():
        if results[cell] is None:
            compose.expect_fit(config, directory / cell.name)
    known = _begun(directory)
    missing = {cell.name: _conditions(config) for cell, config in configs.items() if results[cell] is None}
    begun = {cell.name: known[cell.name] for cell in configs if cell.name in known} | missing

    def renew() -> None:
        finished = tuple(result for result in results.values() if result is not None)
        now = Bench(directory, Comparison(plan, finished), dict(failures), begun)
        now.write()
        tell(now)

    try:
        renew()
        for number, (cell, config) in enumerate(configs.items(), start=1):
            place = directory / cell.name
            if results[cell] is not None and artifacts.exists(place, "report.html"):
                continue
            say(f"\nCell {number} of {len(configs)}: {cell.name}")
            try:
                # A search that was killed at its very end lacks nothing but its report.
                searched = results[cell] is not None
                problems = build(place, config.video, config.env) if searched else compose.search(config, place, host)
                for problem in problems:
                    say(problem)
            except Interrupted:
                raise
            except EurekaError as error:
                failures[cell.name] = error
                say(f"{cell.name} failed: {error}")
            results[cell] = _read(cell, place, failures)
            renew()
    except KeyboardInterrupt:  # between two searches
        raise Interrupted(stopped(host.again(directory))) from None


def _conditions(config: RunConfig) -> Mapping[str, Any]:
    return {"date": datetime.now(UTC).date().isoformat(), "device": config.device, "versions": versions()}


def _begun(directory: Path) -> Mapping[str, Mapping[str, Any]]:
    """`Bench.begun` as an earlier call wrote it."""
    try:
        return json.loads(artifacts.read(directory, JSON) or "{}").get("begun", {})
    except ValueError:
        return {}


def _read(cell: Cell, place: Path, failures: dict[str, EurekaError]) -> figures.Result | None:
    """The numbers of a cell; None where its search is not over or its run cannot be read."""
    try:
        return figures.read(cell, place)
    except EurekaError as error:
        failures[cell.name] = error
        return None


def _expect_room(directory: Path) -> None:
    if directory.is_dir():
        # Files whose names begin with a dot were left by a killed writer.
        taken = not artifacts.exists(directory, JSON) and any(p.name[0] != "." for p in directory.iterdir())
    else:
        taken = directory.exists()
    if taken:
        raise ConfigError(f"{short_path(directory)} is not empty and holds no bench; choose another dir=.")


def _expect_as_begun(directory: Path, configs: Mapping[Cell, RunConfig]) -> None:
    """Refuse a cell that began with other settings before the first cell runs, which may take days."""
    for cell, config in configs.items():
        place = directory / cell.name
        try:
            old = read_config(place)
        except StoreError:  # no run yet, or an unreadable one, which does not concern the others
            continue
        try:
            expect_same(place, old, compose.as_begun(config, old))
        except StoreError as error:
            raise StoreError(f"{error} To start this cell again, delete its folder.") from None
