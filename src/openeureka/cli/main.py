"""The `eureka` command: names, help and errors. Each command is a module of its own, imported when it is called."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from ..errors import EurekaError, StoreError
from ..report.text import plain
from .settings import ContextConfig, PlayConfig, describe

app = typer.Typer(
    name="eureka",
    help="A language model designs reinforcement-learning rewards, a population of policies judges them.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Settings = Annotated[list[str] | None, typer.Argument(metavar="KEY=VALUE", help="Settings, listed below.")]
Words = Annotated[
    list[str] | None, typer.Argument(metavar="KEY=VALUE|PATH", help="Settings, listed below, and a path.")
]


@app.command(epilog=describe(PlayConfig))
def play(words: Words = None) -> None:
    """Write a video of a policy; needs no display.

    Example: eureka play env=cartpole policy=random
    """
    from .play import play

    play(words or [])


@app.command(epilog=describe(ContextConfig))
def context(words: Settings = None) -> None:
    """Print what a language model may know of a task: intent, state table, pruned source.

    Example: eureka context env=cartpole
    """
    from .tasks import context

    context(words or [])


@app.command()
def envs() -> None:
    """List the tasks.

    Example: eureka envs
    """
    from .tasks import envs

    envs()


@app.command()
def doctor() -> None:
    """Say what this machine can do, and what to install where something is missing.

    Example: eureka doctor
    """
    from .doctor import doctor

    raise typer.Exit(doctor())


def main(argv: Sequence[str] | None = None) -> None:
    """Run a command line and exit. A person's errors are one sentence; programming errors stay loud."""
    try:
        app(args=argv, prog_name="eureka")
    except (EurekaError, OSError) as error:
        if os.environ.get("EUREKA_DEBUG") or not _is_for_a_person(error):
            raise
        print(plain(_sentence(error)), file=sys.stderr)
        raise SystemExit(error.exit_code if isinstance(error, EurekaError) else StoreError.exit_code) from None


_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM}


def _is_for_a_person(error: EurekaError | OSError) -> bool:
    return isinstance(error, EurekaError) or error.errno in _DISK


def _sentence(error: EurekaError | OSError) -> str:
    if isinstance(error, EurekaError):
        return str(error)
    place = f" {error.filename}" if error.filename else ""
    return f"Cannot use{place}: {error.strerror}. Free space, change its permissions or name another directory."
