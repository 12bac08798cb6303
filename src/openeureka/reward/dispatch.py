"""Watching torch's operations without loading its compiler, which costs a process a second or two and 70 MB."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from torch.utils._python_dispatch import TorchDispatchMode


class Mode(TorchDispatchMode):
    """A dispatch mode that does without `torch.compile`."""

    def __init__(self) -> None:
        super().__init__()  # pyright: ignore[reportUnknownMemberType]

    @classmethod
    def _should_skip_dynamo(cls) -> bool:
        return False


class _NoCompiler(ModuleType):
    """A stand-in for `torch._dynamo` with the decorator `disable`, the only part that torch's shape rules use."""

    @staticmethod
    def disable(function: Callable[..., Any], *_: object, **__: object) -> Callable[..., Any]:
        return function


def without_compiler() -> None:
    """Let a process that never compiles compute shapes on the meta device without importing `torch._dynamo`."""
    sys.modules.setdefault("torch._dynamo", _NoCompiler("torch._dynamo"))
