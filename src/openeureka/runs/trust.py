"""What a run directory from elsewhere does not decide: whom to ask, what to pay, and which files to read and run.

Settings that reach outside a run are followed when this user has typed them before, on this machine, in a command that
started a run; the user is asked about all others. The record of typed settings holds their values and lies outside the
runs: a run that is moved or copied goes on unasked, and no directory can declare itself trusted.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path

from .. import homes
from ..config import NO_MODEL, RunConfig, TrainConfig
from ..errors import ConfigError
from ..executors import EXECUTORS
from ..parsing import absolute, command_line, short_path
from ..strategies import SEARCHES
from ..tasks import registry
from ..text import plain, visible

RECORD = "typed"
_YAML = (".yaml", ".yml")
_RUN = "is run with your rights"
_REACHES: Mapping[str, tuple[str, Callable[[str], bool]]] = {
    "env": (_RUN, registry.installed),
    "search": (_RUN, SEARCHES.installed),
    "executor": (_RUN, EXECUTORS.installed),
    "address": (
        "is sent the trainings, and whoever answers there can run code with your rights",
        lambda said: said in ("auto", "local"),
    ),
    "curriculum": (
        "is read, and the tasks that it names are run with your rights",
        lambda said: not said.endswith(_YAML),
    ),
    "randomise": ("is read", lambda said: not said.endswith(_YAML)),
    "init": ("is read, and sent to the model", lambda said: said == "human"),
    "model": (
        "is loaded, or asked for rewards, which may cost money",
        lambda said: said in ("local", "random", NO_MODEL),
    ),
    "base_url": ("is sent the prompts and your key", lambda said: not said),
    "price": ("sets what replies are counted to cost", lambda said: not said),
    "log": ("is sent the results of the run", lambda said: said == "tensorboard"),
}
"""Settings that reach outside a run: what happens to the thing that each names, and a test for harmless values."""


def claims(config: RunConfig | TrainConfig) -> dict[str, str]:
    """The settings of a run or a training that reach outside it, by key; paths are absolute."""
    said = {key: str(getattr(config, key, "")) for key in _REACHES}  # a training has fewer settings than a run
    return {
        key: absolute(key, said[key]) for key, (_, inside) in _REACHES.items() if said[key] and not inside(said[key])
    }


def remember(config: RunConfig | TrainConfig) -> None:
    """Record the settings that were typed. Where the record cannot be written, the user is asked again later."""
    fresh = unknown(config)
    if not fresh:
        return
    with suppress(OSError, RuntimeError):
        path = _record()
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        with os.fdopen(descriptor, "w") as file:
            file.write("".join(f"{_line(*claim)}\n" for claim in fresh.items()))


def unknown(config: RunConfig | TrainConfig) -> dict[str, str]:
    """The `claims` that this user has not typed before."""
    known = _known()
    return {key: value for key, value in claims(config).items() if _line(key, value) not in known}


def expect_known(env: str, who: str, way: str) -> None:
    """Raises ConfigError for a task that is neither installed nor was typed here before: to import it is to run it. The
    message says `who` names it, and the `way` to agree."""
    if unknown(RunConfig(env=env)):
        raise ConfigError(
            f"{who} names env={env}, which is not an installed task and was never typed here. Its code runs with your "
            f"rights; if you know where it comes from, {way}."
        )


def agree(
    config: RunConfig | TrainConfig,
    directory: Path,
    *,
    typed: Collection[str],
    trusted: bool,
    way: str,
    asks: bool = False,
) -> None:
    """Have a person agree to what the stored settings of a run reach, except settings that they typed now or before.

    Args:
        typed: keys that are given now.
        trusted: whether the person agreed beforehand.
        way: how to agree, for the error message.
        asks: ask at the terminal, where there is one.

    Raises:
        ConfigError: when nobody agrees.
    """
    asked = {key: value for key, value in unknown(config).items() if key not in typed}
    if asked and not trusted:
        if not (asks and all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stdout))):
            listed = ", ".join(f"{key}={plain(value)}" for key, value in asked.items())
            raise ConfigError(
                f"{short_path(directory)} would use settings that were never typed here: {listed}. If you know where "
                f"it comes from, {way}."
            )
        _ask(asked, directory)
    remember(config)


def _ask(asked: Mapping[str, str], directory: Path) -> None:
    print(f"{short_path(directory)} was not started here. It wants to use:")
    for key, value in asked.items():
        print(f"  {key}={visible(value)}\n    which {_REACHES[key][0]}")
    try:
        answer = input("Do you know where it comes from, and agree? [y/N] ")
    except EOFError:
        answer = ""
    if answer.strip().lower() not in ("y", "yes"):
        command = command_line("show", directory)
        raise ConfigError(f"Nothing was done; `{command}` reads the run without using any of these.")


def _line(key: str, value: str) -> str:
    return json.dumps([key, value])


def _known() -> frozenset[str]:
    try:
        return frozenset(_record().read_text().splitlines())
    except (OSError, UnicodeDecodeError, RuntimeError):
        return frozenset()


def _record() -> Path:
    """Raises RuntimeError for a user without a home directory, as in some containers."""
    return homes.state() / RECORD
