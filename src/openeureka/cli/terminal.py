"""The terminal as the host of a run: what it prints before, while and after it is at work."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from ..config import NO_MODEL, RunConfig, short_name
from ..display.live import PlainView, TerminalView, view
from ..display.progress import working
from ..report.filming import Filming
from ..text import one_line
from ..types import Usage
from .desk import TerminalDesk

CONTROL = "model=random draws by chance and reads neither results nor words. It is the control for a real model."


def again(directory: Path) -> str:
    """The command that goes on with a run."""
    return f"eureka resume {directory}"


class Terminal:
    """See `runs.compose.Host`."""

    def begins(self, config: RunConfig, directory: Path) -> None:
        if config.model == NO_MODEL:
            print(f"{short_name(config.env)}: given rewards, in {directory}")
            return
        size = f"{config.iteration} generations of {config.sample} rewards"
        print(f"{short_name(config.env)}: {size}, written by model={one_line(config.model)}, in {directory}")
        if config.model == "random":
            print(CONTROL)

    def working(self, text: str) -> AbstractContextManager[None]:
        return working(text)

    def view(self, config: RunConfig, directory: Path, usage: Usage) -> PlainView | TerminalView:
        return view(config, usage)

    def desk(self, config: RunConfig, directory: Path, films: Sequence[Filming]) -> TerminalDesk:
        return TerminalDesk(directory, config, films)

    def again(self, directory: Path) -> str:
        return again(directory)
