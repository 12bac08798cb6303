"""Environments in another Python, which `python=PATH` names: `env=python:pkg.mod:NAME`, or an id of a suite's."""

from .resolve import imports, task

__all__ = ["imports", "task"]
