"""Settings of the smaller commands, and how settings are shown in `--help`. Imports nothing heavy."""

from __future__ import annotations

import ast
import dataclasses
import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..config import VIDEOS
from ..errors import ConfigError
from ..parsing import is_setting, short_path

PYTHON = "The Python that the environment is installed in, if it is not this one: `env=dmc:cheetah-run python=PATH`."
TRUST = "The same directory again, to agree to the addresses, files and models that a run from elsewhere names."
"""Notes in `--help` on words that are no settings: a part of `env=`, and a word of `eureka resume` and `robust`."""
EXPORTED = ("gymnasium", "mjlab", "isaaclab")
"""Suites that a reward may be written for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchConfig:
    """Where a bench is kept; all else is in its plan."""

    dir: str = ""
    """Directory of its runs and its page; empty means `outputs/bench_<name of the plan>`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckConfig:
    """Check of one reward file."""

    env: str = "cartpole"
    unsafe_no_sandbox: bool = False
    """Run the file in an unconfined child process where the kernel cannot confine it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportConfig:
    """Report of a run."""

    env: str = ""
    """Task to film, if it is a file or a package of your own; empty means the run's."""
    video: str = ""
    """`all` trained policies, the `best` or `none`; empty means what the run began with."""

    def __post_init__(self) -> None:
        if self.video not in ("", *VIDEOS):
            raise ConfigError(f"`video` must be one of {', '.join(VIDEOS)}, not `{self.video}`.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayConfig:
    """One policy, shown or filmed."""

    env: str = ""
    """Empty means the task of the run directory."""
    policy: str = ""
    """`polished`, `robust`, `random`, `zero` or a policy.safetensors file; empty means the best reward's."""
    beside: str = ""
    """Film a second policy too: `human` (of the run's human reward), `random`, `zero` or a policy.safetensors file."""
    out: str = ""
    """Video to write, even if there is a display; empty means `<env>.mp4`, or `play.mp4` in the run directory."""
    seconds: float = 10.0
    """Length of the video in simulated time."""
    seed: int = 0
    port: int = 0
    """Port of the page of --web, on this machine only; 0 means the first free one from 8080 on."""

    def __post_init__(self) -> None:
        if not 0 <= self.port < 65536:
            raise ConfigError(f"`port` must be between 0 and 65535, not {self.port}.")
        if not 0.0 < self.seconds <= 600.0:
            raise ConfigError(f"`seconds` must be above 0 and at most 600, not {self.seconds}.")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportConfig:
    """A reward for another program."""

    to: str = ""
    """`gymnasium`, `mjlab` or `isaaclab`; empty means where the run's environment comes from."""
    env: str = ""
    """Task of the run, if it was not started on this machine; empty means the run's."""

    def __post_init__(self) -> None:
        if self.to not in ("", *EXPORTED):
            raise ConfigError(f"`to` must be one of {', '.join(EXPORTED)}, not `{self.to}`.")


@dataclass(frozen=True, slots=True, kw_only=True)
class PageConfig:
    """Where `eureka ui` is served."""

    host: str = "127.0.0.1"
    """Address to listen at; by default only this machine can connect."""
    port: int = 8080

    def __post_init__(self) -> None:
        if not self.host.strip():  # sockets take it for every address of the machine
            raise ConfigError("`host` names no address; leave it out to serve this machine only.")
        if not 0 <= self.port < 65536:
            raise ConfigError(f"`port` must be between 0 and 65535, not {self.port}.")


@dataclass(frozen=True, slots=True, kw_only=True)
class NewConfig:
    """A task file that is drafted from a robot."""

    model: str = ""
    """The robot and its scene: a MuJoCo XML file, or a URDF."""
    intent: str = ""
    """What it should do, one sentence for the language model, such as `to hop forward as fast as possible`."""
    object: str = ""
    """Body, site or geom that should reach the goal; empty means what the intent or the model suggests."""
    goal: str = ""
    """Body, site or geom that it should reach; empty means what the intent or the model suggests."""
    floating: bool = False
    """Let a URDF's root move freely above a floor, as for a walking robot; otherwise it is fixed, as for an arm."""
    env: str = ""
    """Instead of a robot, an environment such as `gym:Hopper-v5`: the file then says what rewards may read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DoctorConfig:
    """What to look at."""

    address: str = ""
    """Check the nodes of this Ray cluster instead of this machine: `auto`, `HOST:PORT` or `local`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextConfig:
    """Which task's context to print."""

    env: str = "cartpole"


def split(words: Sequence[str]) -> tuple[list[str], list[Path]]:
    """Separate `key=value` words from paths."""
    settings = [word for word in words if is_setting(word)]
    return settings, [Path(word) for word in words if not is_setting(word)]


def only_path(paths: Sequence[Path], usage: str) -> Path:
    """The single path of a command line. Raises ConfigError for none or several."""
    if any(str(path).startswith("=") for path in paths):
        raise ConfigError(f"Write a setting without spaces around its equals sign; for example: {usage}")
    if len(paths) != 1:
        given = f", not {' and '.join(map(str, paths))}" if paths else ""
        raise ConfigError(f"Name exactly one path{given}; for example: {usage}")
    return paths[0]


def trusting(settings: Sequence[str], directory: Path) -> tuple[list[str], bool]:
    """The settings without `trust=DIR`, and whether it is among them. Raises ConfigError where it names another run."""
    named = [word.removeprefix("trust=") for word in settings if word.startswith("trust=")]
    if other := [name for name in named if Path(name).resolve() != directory.resolve()]:
        raise ConfigError(f"trust={other[0]} does not name this run; write trust={short_path(directory)}.")
    return [word for word in settings if not word.startswith("trust=")], bool(named)


def describe(kind: type, **more: str) -> str:
    """One line per setting: `key=default` and the first line of its docstring, for `--help`.

    Args:
        more: words that the command takes besides the settings, and what each does.
    """
    notes = _attribute_docs(kind)
    lines = list[str]()
    for field in dataclasses.fields(kind):
        default = str(field.default).lower() if isinstance(field.default, bool) else field.default
        lines.append(line(f"{field.name}={default}", notes.get(field.name, "")))
        if field.name == "env":
            lines.append(line("python=", PYTHON))
    lines += [line(f"{name}=", note) for name, note in more.items()]
    return "\n".join(("\b", "Settings and their defaults:", *lines))


def line(setting: str, note: str) -> str:
    """One setting in `--help`."""
    return f"  {setting:<26} {note}".rstrip()


def _attribute_docs(kind: type) -> dict[str, str]:
    """Python drops the strings written below fields, so they are read from the source."""
    notes = _attribute_docs(kind.__base__) if dataclasses.is_dataclass(kind.__base__) else {}
    body = ast.parse(inspect.getsource(kind)).body[0]
    assert isinstance(body, ast.ClassDef)
    for field, text in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
        ):
            notes[field.target.id] = str(text.value.value).split("\n")[0]
    return notes
