"""Task files drafted for `eureka new`, from a robot's model and a sentence."""

from ..opengl import mujoco as mujoco
