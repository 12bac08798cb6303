"""A sandbox whose server has no gate, so that only the kernel confines its children."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from unittest import mock

from openeureka.sandbox import client
from openeureka.sandbox.client import Sandbox
from openeureka.worker import Worker

TESTS = str(Path(__file__).parents[1])


class Ungated(Sandbox):
    """Runs every text unchecked."""

    def _start(self) -> Worker:
        with mock.patch.object(client, "Worker", _worker):
            return super()._start()


def _worker(module: str, *, env: Mapping[str, str], max_blobs: int) -> Worker:
    assert module == "openeureka.sandbox.server"
    return Worker("sandbox.ungated_server", env={**env, "PYTHONPATH": TESTS}, max_blobs=max_blobs)
