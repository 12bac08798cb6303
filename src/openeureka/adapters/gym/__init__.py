"""Gymnasium: `env=gym:ID`, whatever is registered; `env=gym:package:ID` imports the package first."""

from .named import imports, task

__all__ = ["imports", "task"]
