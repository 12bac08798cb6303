"""What a task is, how it is stepped and found; the tasks themselves are in `suite`."""

from ..opengl import mujoco as mujoco
