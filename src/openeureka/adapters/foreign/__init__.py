"""Environments in another Python, which `python=PATH` names: `env=python:pkg.mod:NAME`, `mjlab:ID`, `isaaclab:ID`."""

from .named import imports, task

__all__ = ["imports", "task"]
