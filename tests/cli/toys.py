"""Helpers for tests of commands: one runs a command line, one replaces the sandbox."""

from __future__ import annotations

import pytest

from openeureka.cli import main as command
from openeureka.testing.scripted import ToyChecker


def eureka(*words: object) -> int:
    """Run a command line. Returns its exit code."""
    with pytest.raises(SystemExit) as exit:
        command.main([str(word) for word in words])
    return int(exit.value.code or 0)


class ToySandbox(ToyChecker):
    """Stands in for `sandbox.client.Sandbox`: opened like it, but judges in this process."""

    def __init__(self, *_: object, unsafe: bool, **__: object) -> None:
        super().__init__()
        self.unsafe = unsafe

    def __enter__(self) -> ToySandbox:
        return self

    def __exit__(self, *_: object) -> None: ...
