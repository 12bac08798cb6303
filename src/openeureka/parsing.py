"""Builds config dataclasses from `key=value` words, from Python values and from stored settings."""

from __future__ import annotations

import ast
import dataclasses
import json
import os
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_type_hints

from .errors import ConfigError, nearest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from yaml import SafeLoader

_LONGEST = 4096
"""Most characters of a setting: the length of the longest path."""
_CODE = r"()(.+\.py)(:.*)?"
_FILES = {
    "env": r"((?:python:)?)(?!gym(?:-asis)?:)(.+\.py)([:+].*)?",
    "search": _CODE,
    "executor": _CODE,
    "init": r"()(?!human\Z)(.+)()",
    "curriculum": r"()(.+\.ya?ml)()",
    "randomise": r"()(.+\.ya?ml)()",
    "model": r"(replay:|local:(?!hub:)|(?=.+\.py:))(.+?)((?<=\.py):.+)?",
}
_PLACES = {"beside", "dir", "out", "policy", "reward"}
"""Settings that name files for one command only, from the working directory. `~` is expanded here, since not every
shell expands it after an equals sign."""

_PYTHON = "python"
"""Given together with `env`, and not a setting by itself: see `elsewhere`."""
_hints = cache(get_type_hints)
"""Cached: evaluating the annotations of a config takes longer than reading one."""


def is_setting(word: str) -> bool:
    """Whether a word of a command line is `key=value`. A path with an equals sign has a slash before it: `./lr=3`."""
    return re.match(r"\w+=", word) is not None


def command_line(*words: object) -> str:
    """The command line that runs `eureka` with these words, as a person types it. A path with a space is quoted; one
    that looks like a setting or an option begins with `./`."""

    def typed(word: object) -> str:
        if not isinstance(word, Path):
            return str(word)
        text = str(short_path(word))
        return f"./{text}" if text.startswith("-") or is_setting(text) else text

    return shlex.join(["eureka", *map(typed, words)])


def whole_path(path: str | PathLike[str]) -> Path:
    """The absolute path, with `~` expanded. Links are not followed, so that people see the path that they typed."""
    return Path(os.path.abspath(os.path.expanduser(path)))


def short_path(path: Path) -> Path:
    """The path as shown to people: relative to the working directory if it lies below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def absolute(key: str, value: str, folder: Path = Path()) -> str:
    """The value of a setting, with the file that it names from `folder` as an absolute path; other values unchanged. In
    `_PLACES` only `~` is expanded."""
    if key in _PLACES:
        return ",".join(map(os.path.expanduser, value.split(",")))
    match = re.fullmatch(_FILES.get(key, "(?!)"), value)
    return f"{match[1]}{(folder / os.path.expanduser(match[2])).resolve()}{match[3] or ''}" if match else value


def named_file(key: str, value: str) -> str:
    """The file that the value of a setting names, as written there; empty where it names none."""
    match = re.fullmatch(_FILES.get(key, "(?!)"), value)
    return match[2] if match else ""


def elsewhere(settings: Mapping[str, object]) -> dict[str, object]:
    """The settings with `python=PATH` moved into the value of `env`. PATH is the interpreter that has the environment.

    `tasks.registry.get` knows which environments accept it. The path is made absolute, but links are not followed: the
    interpreter of a virtual environment is a link.
    """
    found = dict(settings)
    if "env" not in found or _PYTHON not in found:
        return found
    python = str(found.pop(_PYTHON))
    if not python:
        return found
    whole = os.path.abspath(os.path.expanduser(python)) if os.sep in python else python
    return found | {"env": f"{found['env']}+python={whole}"}


def whole_number(value: str) -> int:
    """A whole number, also as people write large ones: `1e6`, `2.5e5`."""
    if re.fullmatch(r"[+-]?\d+(\.\d*)?[eE]\+?\d{1,2}", value) and float(value).is_integer():
        return int(float(value))
    return int(value)


_SPELLED = {"True": True, "False": False, "None": None}
"""Constants that Python and JSON spell differently."""


def literal(text: str) -> Any:
    """The value of a text in JSON or in Python's syntax, a tuple as a list; any other text is returned as it is."""
    with suppress(ValueError, RecursionError):
        return _SPELLED[text] if text in _SPELLED else json.loads(text)
    if text[:1] in ("(", "[", "{"):  # other text may be a name: Python takes 1_000 for a number
        with suppress(ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
            return json.loads(json.dumps(ast.literal_eval(text)))
    return text


_WANTED = {"int": "a whole number, such as 8 or 1e6", "float": "a number", "bool": "true or false"}

Config = TypeVar("Config", bound="DataclassInstance")


def parse(kind: type[Config], words: Sequence[str]) -> Config:
    """Build a frozen config dataclass from `key=value` words. Values are taken literally: no variables are expanded.

    Raises:
        ConfigError: for a word that is not `key=value`, an unknown or repeated key or a value of the wrong type.
    """
    return kind(**_typed(kind, words))


def changed(config: Config, words: Sequence[str]) -> Config:
    """A copy of the config with the settings of `key=value` words. Raises ConfigError as `parse` does."""
    return dataclasses.replace(config, **_typed(type(config), words))


def _typed(kind: type, words: Sequence[str]) -> dict[str, Any]:
    hints = _hints(kind)
    values: dict[str, Any] = {}
    given: dict[str, object] = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign:
            example = f"reward={word}" if word.endswith(".py") and "reward" in hints else "env=cartpole"
            raise ConfigError(f"`{word}` is not of the form key=value, for example {example}.")
        if key in given:
            raise ConfigError(f"`{key}` is set twice, to `{given[key]!s:.80}` and to `{value:.80}`; set it once.")
        given[key] = value
    for key, value in elsewhere(given).items():
        _expect_known(key, hints)
        value = str(value)
        try:
            values[key] = _READ[hints[key]](absolute(key, value))
        except ValueError:
            raise _unfit(key, value, hints[key]) from None
        _expect_storable(key, values[key])
    return values


def _expect_known(key: str, hints: Mapping[str, type]) -> None:
    if key in hints:
        return
    known = [*hints, *([_PYTHON] if "env" in hints else [])]
    if key == _PYTHON and _PYTHON in known:
        raise ConfigError("`python=` names the Python in which the environment is installed; add env=.")
    meant = nearest(key, known)
    others = " `--help` lists all settings." if meant else f" Settings: {', '.join(known)}."
    raise ConfigError(f"Unknown setting `{key}`.{meant}{others}")


def _unfit(key: str, value: object, kind: type) -> ConfigError:
    wanted = _WANTED.get(kind.__name__, "text")
    return ConfigError(f"`{key}={value!s:.80}` does not fit: `{key}` takes {wanted}.")


def plain_number(value: Any) -> Any:
    """A scalar of NumPy or PyTorch as a Python number; any other value unchanged."""
    return value.item() if hasattr(value, "item") and not getattr(value, "shape", True) else value


def taken(kind: type, settings: Mapping[str, object]) -> dict[str, Any]:
    """Python values as the fields of a config dataclass hold them: paths as text, 1e6 as a whole number.

    Raises:
        ConfigError: for an unknown key or a value of the wrong type.
    """
    hints = _hints(kind)
    values: dict[str, Any] = {}
    for key, value in elsewhere(settings).items():
        _expect_known(key, hints)
        wanted = hints[key]
        given: Any = str(value) if isinstance(value, Path) else plain_number(value)
        if wanted is int and isinstance(given, float) and given.is_integer():
            given = int(given)
        if type(given) is not wanted and (type(given), wanted) != (int, float):
            raise _unfit(key, value, wanted)
        values[key] = absolute(key, given) if isinstance(given, str) else wanted(given)
        _expect_storable(key, values[key])
    return values


def _expect_storable(key: str, value: object) -> None:
    """Refuse a value that `restored` would refuse, before it is stored."""
    if isinstance(value, str) and len(value) > _LONGEST:
        raise ConfigError(f"`{key}` has {len(value):,} characters; a setting has at most {_LONGEST:,}: shorten it.")
    if isinstance(value, str) and "\0" in value:
        raise ConfigError(f"`{key}` holds a zero byte; write it as plain text.")


_SWITCH = {
    **dict.fromkeys(("true", "yes", "on", "y", "1"), True),
    **dict.fromkeys(("false", "no", "off", "n", "0"), False),
}


def _switch(text: str) -> bool:
    if text.lower() not in _SWITCH:
        raise ValueError(text)
    return _SWITCH[text.lower()]


_READ: Mapping[type, Callable[[str], Any]] = {str: str, int: whole_number, float: float, bool: _switch}


def restored(kind: type[Config], stored: object) -> Config:
    """The config from data that `asdict` wrote and anyone may have edited; missing fields get their defaults.

    Raises:
        ConfigError: for an unknown field or a value out of range.
        TypeError: for data of another type, or text that is too long or holds a zero byte.
    """
    hints = _hints(kind)
    if not isinstance(stored, dict):
        raise TypeError("settings are a mapping")
    settings = cast(dict[str, object], stored)
    for key, value in settings.items():
        if key not in hints:
            raise ConfigError(f"There is no setting `{key}`.")
        if type(value) is not hints[key] and (type(value), hints[key]) != (int, float):
            raise TypeError(f"`{key}` takes {hints[key].__name__}")
        if isinstance(value, str) and (len(value) > _LONGEST or "\0" in value):
            raise TypeError(f"`{key}` is no text of a setting")
    return kind(**settings)


def read_yaml(path: Path, kind: str, loader: type[SafeLoader] | None = None) -> Any:
    """Contents of a YAML file.

    Args:
        kind: what the file is called, such as `plan`.

    Raises:
        ConfigError: when it cannot be read, or is not YAML.
    """
    import yaml  # most commands read none

    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=loader or yaml.SafeLoader)
    except OSError as error:
        raise ConfigError(f"Cannot read the {kind} {path}: {error.strerror}; check its path and permissions.") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError(f"The {kind} {path} is not YAML: {' '.join(str(error).split())}.") from None
