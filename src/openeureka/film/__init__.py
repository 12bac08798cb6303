"""Shows a policy at work: pictures, films, windows. This package knows tasks and policies, but no runs."""

from ..opengl import mujoco as mujoco
