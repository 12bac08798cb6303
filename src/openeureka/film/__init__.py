"""A policy at work, to look at: pictures, films, windows. It knows tasks and policies, and no run."""

from ..opengl import mujoco as mujoco
