"""Starts runs that outlive the page."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from ..config import RunConfig, parse
from ..errors import ConfigError
from ..store import LOG
from ..store.db import explained
from ..store.paths import output_directory
from ..tasks import registry

SETTINGS = ("env", "model", "sample", "iteration", "steps", "seed", "device", "video")
"""What the form asks for. Addresses and paths stay on the command line: a page must not send keys somewhere."""

_EUREKA = (sys.executable, "-c", "from openeureka.cli.main import main; main()")


class Launcher:
    """Keeps the processes it started only to see how those end that never begin a run."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, form: Mapping[str, str]) -> str:
        """Begin a search with the settings of a form, those left empty at their defaults; the name of the run.

        Raises:
            ConfigError: for a setting that does not fit, or an environment that `eureka envs` does not list.
            StoreError: where the folder cannot be written.
        """
        words = [f"{key}={form[key].strip()}" for key in SETTINGS if form.get(key, "").strip()]
        config = parse(RunConfig, words)
        if config.env not in registry.names():
            raise ConfigError(f"`{config.env}` is not a task that can be started from here; use `eureka run`.")
        directory = output_directory("", config.env, root=self._root)
        with explained(directory):
            directory.mkdir(parents=True)  # takes the name
            with (directory / LOG).open("xb") as log:
                self._processes[directory.name] = subprocess.Popen(
                    [*_EUREKA, "run", *words, f"dir={directory}"],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=os.environ | {"PYTHONUNBUFFERED": "1"},
                    start_new_session=True,  # Ctrl-C and a closed terminal end the page, not the run
                )
        return directory.name

    def starting(self, name: str) -> bool:
        """Whether a run that has no store yet is on its way."""
        process = self._processes.get(name)
        return process is not None and process.poll() is None
