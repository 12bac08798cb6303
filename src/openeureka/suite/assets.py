"""Files that tasks read: robot models that an installed wheel ships, as data, and human rewards."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from ..errors import TaskError

REWARDS = Path(__file__).parent / "rewards"
"""Reward programs by the original authors of the tasks."""


def wheel_file(package: str, path: str) -> Path:
    """Absolute path of a data file (`path` inside the installed `package`, which is never imported).

    Raises:
        TaskError: when the package or the file is missing.
    """
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        if (found := Path(folder, path)).is_file():
            return found
    distribution = package.replace("_", "-")
    raise TaskError(f"The robot model {path} of {distribution} is missing; run `pip install {distribution}`.")
