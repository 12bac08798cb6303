"""Folders for a user's own files, by the platform's conventions."""

from __future__ import annotations

from pathlib import Path

import platformdirs


def state() -> Path:
    """Folder of what commands remember. Raises RuntimeError for a user without a home, as in some containers."""
    return _whole(platformdirs.user_state_dir("openeureka"))


def cache() -> Path:
    """Folder of what can be made or fetched again. Raises RuntimeError as `state` does."""
    return _whole(platformdirs.user_cache_dir("openeureka"))


def _whole(folder: str) -> Path:
    """Refuse a relative path: older versions of platformdirs leave `~` in it where they find no home directory, and a
    folder of that name would be made here."""
    if not Path(folder).is_absolute():
        raise RuntimeError("no home directory")
    return Path(folder)
