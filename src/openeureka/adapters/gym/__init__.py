"""Gymnasium's environments as tasks: `env=gym:ID`; `env=gym:package:ID` first imports the package that registers it."""

from .resolve import imports, task

__all__ = ["imports", "task"]
