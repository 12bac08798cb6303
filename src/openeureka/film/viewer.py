"""A policy at work in MuJoCo's window."""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings

import glfw
import mujoco.viewer

from ..errors import EurekaError
from .stage import Stage

CLOSING = 10.0
"""[s] that a window may take to close."""


class ViewerUnavailable(EurekaError):
    """No window can be opened, or no page served."""


def has_display() -> bool:
    """Whether a window can be opened. A display is tried, as the variables may name one that is gone."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    with warnings.catch_warnings(action="ignore"):
        return bool(glfw.init())


def window(stage: Stage) -> None:
    """Show the stage until its window is closed. Raises ViewerUnavailable."""
    others = set(threading.enumerate())
    try:
        with mujoco.viewer.launch_passive(stage.model, stage.data, show_left_ui=False, show_right_ui=False) as viewer:
            view = stage.director.hand_over()
            for name in ("type", "trackbodyid", "distance", "azimuth", "elevation", "lookat"):
                setattr(viewer.cam, name, getattr(view, name))
            while viewer.is_running():
                begun = time.monotonic()
                with viewer.lock():
                    stage.step()
                viewer.sync()
                time.sleep(max(0.0, begun + stage.dt - time.monotonic()))
    except RuntimeError as error:
        raise ViewerUnavailable(f"No window can be opened ({error}); add --web, or out=FILE.mp4.") from None
    finally:
        # MuJoCo draws in a daemon thread. If it still does when the process ends, glfw takes the window from under it,
        # and the process hangs.
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSING)
