"""Imports MuJoCo even if MUJOCO_GL names an OpenGL that is not installed: only pictures need one.

A package that uses MuJoCo imports this module first. After that, its modules and tasks of others import MuJoCo as
usual.
"""

from __future__ import annotations

import os

__all__ = ["missing", "mujoco"]

missing = ""
"""MuJoCo's error message about the OpenGL that MUJOCO_GL names; empty if that can be loaded."""


def _restore(name: str, value: str | None) -> None:
    os.environ.pop(name, None)
    if value is not None:
        os.environ[name] = value


_named, _platform = os.environ.get("MUJOCO_GL"), os.environ.get("PYOPENGL_PLATFORM")
try:
    import mujoco
except (AttributeError, OSError, RuntimeError) as error:  # AttributeError: PyOpenGL lacks the library
    if not _named:
        raise
    missing = f"{type(error).__name__}: {error}"
    del os.environ["MUJOCO_GL"]
    _restore("PYOPENGL_PLATFORM", _platform)  # MuJoCo has set it, and the process that renders videos would fail on it
    try:
        import mujoco
    finally:
        _restore("MUJOCO_GL", _named)  # a video tries the OpenGL that a person named
