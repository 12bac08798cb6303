"""`eureka ui`."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import ConfigError
from ..parsing import parse
from ..store.directory import OUTPUTS
from .settings import PageConfig, only_path, split


def ui(words: Sequence[str]) -> None:
    """Serve the page of the runs below a folder."""
    settings, paths = split(words)
    config = parse(PageConfig, settings)
    try:
        from ..ui.server import serve
    except ModuleNotFoundError as error:
        raise ConfigError(f"The page needs {error.name}: pip install 'openeureka[ui]'.") from None
    folder = only_path(paths or [OUTPUTS], "eureka ui outputs")
    if paths and not folder.is_dir():
        raise ConfigError(f"There is no folder {folder}; name the one that holds your runs.")
    serve(folder, config.host, config.port)
