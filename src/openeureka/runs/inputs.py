"""Copies the files that settings of a run name, and refuses to go on when such a file has changed."""

from __future__ import annotations

from pathlib import Path

import yaml

from ..config import RunConfig
from ..errors import ConfigError
from ..parsing import short_path
from ..store import artifacts

NAMED = ("curriculum", "randomise")
"""Settings that may name a YAML file. Its copy in the run's directory has the setting's name."""


def keep(config: RunConfig, directory: Path) -> None:
    """Copy the files into the directory of a run that begins, or check that they still say the same.

    The caller holds the run's lock, and has read the files.

    Raises:
        ConfigError: where one says something else than when the run began.
        StoreError: when the directory cannot be written.
    """
    for setting in NAMED:
        path, copy = str(getattr(config, setting)), f"{setting}.yaml"
        if not path.endswith((".yaml", ".yml")):
            continue
        text, before = Path(path).read_bytes(), artifacts.read(directory, copy)
        if before is None:
            artifacts.write(directory, copy, text)
        elif before != text and _said(before) != _said(text):
            raise ConfigError(
                f"{short_path(Path(path))} has changed since the run began. "
                f"Copy {short_path(directory / copy)} over it, or start a new run."
            )


def _said(text: bytes) -> object:
    """The content of a YAML file without its layout; the text itself where it is no YAML.

    The copy may come from anybody. No object is built from it, because its anchors and tags may expand to anything.
    """
    try:
        return [
            (type(part), *(getattr(part, name, None) for name in ("anchor", "tag", "implicit", "value")))
            for part in yaml.parse(text)
        ]
    except (yaml.YAMLError, ValueError, OverflowError):  # the last two: escapes of impossible characters
        return text
