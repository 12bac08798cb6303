"""Goals in pictures: where a task wants a body, a see-through copy of it stands."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import chain

import mujoco
from torch import Tensor

from ..tasks.rotations import wxyz
from ..tasks.task import Task

PREFIX = "goal of "
COLOUR = (0.3, 0.85, 0.4, 0.4)


def add_ghosts(spec: mujoco.MjSpec, task: type[Task], bodies: Collection[str]) -> None:
    """Add copies of bodies that hang on the world to a task's model; they are moved by hand and touch nothing."""
    if not bodies:
        return
    copies = task.model()
    # From what refers to what is referred to: deleting a body would take along what others still name.
    lively = (copies.sensors, copies.actuators, copies.equalities, copies.excludes, copies.tendons, copies.joints)
    scenery = (copies.worldbody.geoms, copies.lights, copies.cameras)
    unwanted = [body for body in copies.worldbody.bodies if body.name not in bodies]
    for element in chain(*lively, *scenery, unwanted):
        copies.delete(element)
    for body in copies.worldbody.bodies:
        body.mocap = True
    for geom in copies.geoms:
        geom.contype, geom.conaffinity, geom.material, geom.rgba = 0, 0, "", COLOUR
    spec.attach(copies, prefix=PREFIX, frame=spec.worldbody.add_frame())


def place_ghosts(model: mujoco.MjModel, data: mujoco.MjData, poses: Mapping[str, Tensor]) -> None:
    """Move the copies to the poses (N, 7) of the first world."""
    for body, pose in poses.items():
        index = model.body(PREFIX + body).mocapid[0]
        data.mocap_pos[index], data.mocap_quat[index] = pose[0, :3].numpy(), wxyz(pose[0, 3:]).numpy()
