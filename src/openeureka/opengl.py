"""MuJoCo, also where MUJOCO_GL names an OpenGL that is not here: only pictures need one, and MuJoCo fails without.

A package that uses MuJoCo loads this first: then its modules, and tasks of others, import MuJoCo as ever.
"""

from __future__ import annotations

import os

__all__ = ["missing", "mujoco"]

missing = ""
"""What MuJoCo said of the OpenGL that MUJOCO_GL names; empty where it is here."""


def _restore(name: str, value: str | None) -> None:
    os.environ.pop(name, None)
    if value is not None:
        os.environ[name] = value


_named, _platform = os.environ.get("MUJOCO_GL"), os.environ.get("PYOPENGL_PLATFORM")
try:
    import mujoco
except (AttributeError, OSError, RuntimeError) as error:  # the first is PyOpenGL's for a library that is not here
    if not _named:
        raise
    missing = f"{type(error).__name__}: {error}"
    del os.environ["MUJOCO_GL"]
    _restore("PYOPENGL_PLATFORM", _platform)  # MuJoCo has set it, and a video's process would stumble over it
    try:
        import mujoco
    finally:
        _restore("MUJOCO_GL", _named)  # a video tries what a person names
