"""What a person does from the page: start runs that outlive it, continue runs, and make remarks on one."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ..config import RunConfig
from ..errors import ConfigError, FeedbackError, StoreError
from ..executors.local import devices
from ..llm import expect, is_plain, open_model
from ..parsing import parse
from ..store import Store, artifacts, is_held, is_run
from ..store.db import LOG, explained
from ..store.directory import awaits_go, output_directory
from ..store.remarks import is_marked, remark, typed
from ..tasks import registry
from ..types import Remark, RemarkKind
from ..worker import environment, interpreter

SETTINGS = ("env", "model", "sample", "iteration", "steps", "seed", "device", "feedback", "video")
"""What the form asks for. Addresses and paths stay on the command line: no page may decide where a key is sent."""

_EUREKA = (*interpreter(), "-c", "from openeureka.__main__ import main; main()")


class Launcher:
    """Starts `eureka` processes, and collects those that have ended."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._processes: list[subprocess.Popen[bytes]] = []

    def start(self, form: Mapping[str, str]) -> str:
        """Begin a search with the settings of a form, and return the name of the run. Empty fields mean the defaults.

        Raises:
            ConfigError: for a setting that does not fit, an environment that is not installed, or a model that is a
                file, a download or somebody's code.
            TaskError: for an environment that an adapter does not find.
            ModelError: for a model whose key is missing, or that is not there.
            StoreError: where the folder cannot be written.
        """
        if is_run(self._root):
            raise ConfigError("This page shows a single run; to start others, call `eureka ui` with its parent folder.")
        words = [f"{key}={form[key].strip()}" for key in SETTINGS if form.get(key, "").strip()]
        config = parse(RunConfig, words)
        if not registry.installed(config.env):
            raise ConfigError(f"`{config.env}` is not a task that can be started from here; use `eureka run`.")
        if not is_plain(config.model):
            raise ConfigError(f"`{config.model}` is not a model that can be used from here; use `eureka run`.")
        registry.get(config.env)
        devices(config.device)
        expect(config)
        open_model(config).close()
        directory = output_directory("", config.env, root=self._root)
        self._eureka(["run", *words, f"dir={directory}"], directory)
        return directory.name

    def resume(self, directory: Path) -> None:
        """Continue a search as `eureka resume` does. Raises StoreError when a process works on it."""
        if is_held(directory):
            raise StoreError(f"The run in {directory} is already running.")
        self._eureka(["resume", str(directory.absolute())], directory)  # `lr=3` alone would be a setting

    def _eureka(self, words: Sequence[str], directory: Path) -> None:
        """Call `eureka` with these words; what it prints ends up in the log of the run."""
        self._processes = [process for process in self._processes if process.poll() is None]
        with explained(directory), artifacts.appended(directory, LOG) as log:
            self._processes.append(
                subprocess.Popen(
                    [*_EUREKA, *words],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=environment() | {"PYTHONUNBUFFERED": "1"},
                    start_new_session=True,  # Ctrl-C and a closed terminal end the page, not the run
                )
            )


class Ear(NamedTuple):
    """Whether a run listens to remarks."""

    listens: bool
    """A remark that is made now will reach the model."""
    waits: bool
    """The run waits for a person's `go`."""


def ear(directory: Path) -> Ear:
    """Raises StoreError when there is no run."""
    with Store.view(directory) as store:
        hearings = store.config.hearings
        replays = store.config.model.startswith("replay:")  # a replay repeats the recorded remarks
        listens = hearings > 0 and not replays and store.remarks.heard(hearings - 1) is None
        waits = listens and awaits_go(store) and is_held(directory)
    return Ear(listens=listens, waits=waits)


def read(form: Mapping[str, str]) -> tuple[Remark, ...]:
    """The remarks of a form: `words`, a candidate as `favourite` or `veto`, a `vote` such as g0s3:g0s1, and `go`.

    A line of the words that holds a mark, or is `go`, means what it means in a shell.

    Raises:
        FeedbackError: where a candidate is not named like g0s1, a mark is misspelt, or nothing is said.
    """
    remarks = [remark(f"{mark}={form[mark]}") for mark in ("favourite", "veto", "vote") if mark in form]
    lines = form.get("words", "").splitlines()
    remarks += [said for line in lines if is_marked(line) for said in typed(line)]
    if words := "\n".join(line for line in lines if not is_marked(line)).strip():
        remarks.append(remark(words))
    if "go" in form:
        remarks.append(Remark(kind=RemarkKind.GO))
    if not remarks:
        raise FeedbackError("Nothing was said; write some words, or choose a candidate.")
    return tuple(sorted(remarks, key=lambda said: said.kind is RemarkKind.GO))  # remarks after `go` might come too late
