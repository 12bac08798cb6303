"""Environments in another Python, which `python=PATH` names: `env=python:pkg.mod:NAME`, or an id of a suite's."""

from .named import imports, task

__all__ = ["imports", "task"]
