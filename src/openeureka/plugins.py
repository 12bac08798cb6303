"""Extension points: a built-in name, a name of an installed package, `pkg.mod:Name` or `FILE.py:Name`."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from importlib.metadata import entry_points
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any

from .errors import ConfigError, EurekaError, nearest, told


@dataclass(frozen=True, slots=True)
class Door:
    """An extension point: what one setting may name, a class or function that makes an object."""

    setting: str
    group: str
    """Group of entry points through which installed packages add names."""
    built_in: Mapping[str, str]
    """`pkg.mod:Name` by built-in name; no package can replace a built-in."""
    members: tuple[str, ...]
    """Attributes and methods that the made object must have."""

    def names(self) -> list[str]:
        """All names, built-in ones first."""
        return list(dict.fromkeys([*self.built_in, *self._added()]))

    def installed(self, value: str) -> bool:
        """Whether the value is a known name: then `find` imports no code that the value chose."""
        return value in self.built_in or value in self._added()

    def _added(self) -> dict[str, str]:
        """`pkg.mod:Name` by name, from installed packages; the lookup is slow."""
        return {point.name: point.value for point in entry_points(group=self.group)}

    def find(self, value: str) -> Callable[..., Any]:
        """The class or function.

        Raises:
            ConfigError: when there is none of that name, or it cannot be imported.
        """
        module, sign, name = (self.built_in.get(value) or self._added().get(value) or value).rpartition(":")
        if value.endswith(".py"):
            raise ConfigError(f"Name the class or function in {value}: {self.setting}={value}:Name.")
        if not sign:
            raise ConfigError(
                f"There is no {self.setting} `{value}`.{nearest(value, self.names())} Use {', '.join(self.names())}, "
                "or your own: pkg.mod:Name or FILE.py:Name."
            )
        file = Path(module).resolve() if module.endswith(".py") else None
        if file and not file.is_file():
            raise ConfigError(f"There is no file {file}; {self.setting}=FILE.py:Name must name an existing file.")
        try:
            found = import_file(file) if file else importlib.import_module(module)
        except (Exception, SystemExit) as error:  # whatever a person's code raises
            raise ConfigError(
                f"`{self.setting}={value}` cannot be imported: {told(error)}{where_to_put(module, error)}"
            ) from error
        if not callable(getattr(found, name, None)):
            makers = [known for known, own in vars(found).items() if callable(own)]
            raise ConfigError(f"There is no class or function `{name}` in {module}.{nearest(name, makers)}")
        return getattr(found, name)

    def make(self, value: str, *args: object, **options: object) -> Any:
        """Call what `find` finds.

        Raises:
            ConfigError: as `find` does, and when the call does not fit or fails, or the object lacks a member.
        """
        factory = self.find(value)
        try:
            inspect.signature(factory).bind(*args, **options)
        except TypeError as error:
            given = ", ".join([*(type(arg).__name__ for arg in args), *(f"{name}=" for name in options)])
            raise ConfigError(f"`{self.setting}={value}` cannot be called with ({given}): {error}.") from error
        try:
            made = factory(*args, **options)
        except EurekaError:
            raise
        except Exception as error:  # a person's code may raise anything; an error of a built-in is a bug here
            if value in self.built_in:
                raise
            frame = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(frame.filename).name}, line {frame.lineno}"
            raise ConfigError(f"`{self.setting}={value}` failed in {place}: {told(error)}") from error
        if missing := [name for name in self.members if not hasattr(made, name)]:
            raise ConfigError(f"The object that `{self.setting}={value}` makes lacks {', '.join(missing)}.")
        return made


def where_to_put(module: str, error: BaseException) -> str:
    """A hint for a module that Python does not find; empty for any other error."""
    unfound = isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]
    return " Put the folder that holds it on PYTHONPATH: export PYTHONPATH=." if unfound else ""


class _Fresh(SourceFileLoader):
    """Uses no `.pyc` files: after an edit of equal length within the same second, Python would take the old one."""

    def path_stats(self, path: object) -> Mapping[str, Any]:
        raise OSError


_importing = RLock()
"""Held while importing: another thread would find the module half executed."""


def import_file(path: Path) -> ModuleType:
    """Import a file in its present state, once per process. The module's name contains a hash of path and contents, so
    an edited file is never mistaken for its earlier version."""
    name = f"openeureka_file_{hashlib.sha256(bytes(path) + bytes(1) + path.read_bytes()).hexdigest()[:12]}"
    with _importing:
        if name not in sys.modules:
            spec = importlib.util.spec_from_file_location(name, path, loader=_Fresh(name, str(path)))
            assert spec is not None and spec.loader is not None
            # Dataclasses and `inspect` look up a class's module by name while it is still being executed.
            sys.modules[name] = importlib.util.module_from_spec(spec)
            try:
                spec.loader.exec_module(sys.modules[name])
            except BaseException:
                del sys.modules[name]
                raise
        return sys.modules[name]
