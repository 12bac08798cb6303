"""`eureka feedback` and `eureka stop`, which speak to a run in another process, and `eureka ui`, the page for that.

None of them loads PyTorch.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..errors import ConfigError, FeedbackError, StoreError
from ..parsing import command_line, parse
from ..runs.stopping import stopped
from ..store import Store, is_held, say
from ..store.directory import OUTPUTS, ask_to_stop
from ..store.remarks import spoken
from ..types import RemarkKind
from .settings import PageConfig, only_path, split

PATIENCE = 150.0
"""[s] within which a run must stop when asked to: where epochs are long, saving a training takes up to 100."""


def feedback(directory: Path, words: Sequence[str]) -> None:
    """Commit the remarks and say what follows."""
    remarks = spoken(words)
    if not remarks:
        raise FeedbackError('Say something, for example: eureka feedback DIR "too jerky" favourite=g0s3 go')
    say(directory, *remarks)
    if not is_held(directory):
        print(f"Saved. The run has stopped; continue it with: {command_line('resume', directory)}")
        return
    go = any(said.kind is RemarkKind.GO for said in remarks)
    print("The run continues." if go else "Saved for the next generation; the run continues when you say `go`.")


def stop(directory: Path) -> None:
    """Stop the run and wait until it has. Raises StoreError when it is not running, or goes on."""
    ask_to_stop(directory)
    end = time.monotonic() + PATIENCE
    while is_held(directory):
        if time.monotonic() > end:
            raise StoreError(f"The run in {directory} was asked to stop but still runs; end its process.")
        time.sleep(0.1)
    print(stopped("" if _ended(directory) else command_line("resume", directory)))


def _ended(directory: Path) -> bool:
    """Whether the run had ended, and what was stopped came after it, such as `eureka robust`: no resume is needed."""
    with suppress(StoreError), Store.view(directory) as store:
        return store.ended
    return False


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
