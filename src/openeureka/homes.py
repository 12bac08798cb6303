"""Where a user's own files are kept, as the platform has it."""

from __future__ import annotations

from pathlib import Path

import platformdirs


def state() -> Path:
    """What a command remembers. Raises RuntimeError for a user without a home directory, as in some containers."""
    return _whole(platformdirs.user_state_dir("openeureka"))


def cache() -> Path:
    """What can be made or fetched again. Raises RuntimeError as `state`."""
    return _whole(platformdirs.user_cache_dir("openeureka"))


def _whole(folder: str) -> Path:
    """Older versions of platformdirs leave `~` where they find no home: a folder of that name would be made here."""
    if not Path(folder).is_absolute():
        raise RuntimeError("no home directory")
    return Path(folder)
