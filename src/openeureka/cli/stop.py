"""`eureka stop`."""

from __future__ import annotations

import time
from pathlib import Path

from ..errors import StoreError
from ..runs.stopping import stopped
from ..store import is_held
from ..store.directory import ask_to_stop
from .terminal import again

PATIENCE = 60.0
"""[s] in which a run that was asked must have stopped."""


def stop(directory: Path) -> None:
    """Stop the run and wait until it has. Raises StoreError when it is not running, or goes on."""
    ask_to_stop(directory)
    end = time.monotonic() + PATIENCE
    while is_held(directory):
        if time.monotonic() > end:
            raise StoreError(f"The run in {directory} was asked to stop and goes on; end its process where it runs.")
        time.sleep(0.1)
    print(stopped(again(directory)))
