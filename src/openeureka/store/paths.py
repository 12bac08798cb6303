"""Where outputs go."""

from __future__ import annotations

import time
from pathlib import Path

from ..config import short_name

OUTPUTS = Path("outputs")


def output_directory(chosen: str, env: str, kind: str = "", root: Path = OUTPUTS) -> Path:
    """The chosen directory, or a new name `<root>/<time>_<kind><env>`; nothing is made yet."""
    if chosen:
        return Path(chosen)
    path = root / f"{time.strftime('%Y-%m-%d_%H-%M-%S')}_{kind}{short_name(env)}"
    number = 2
    while path.exists():
        path = path.with_name(f"{path.name.split('~')[0]}~{number}")
        number += 1
    return path
