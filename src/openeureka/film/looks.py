"""How a task looks in pictures: sky, ground, light, materials, and ghosts where bodies are wanted.

All of it is made of MuJoCo's built-in textures, on a copy of the task's model that is drawn and never simulated.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from itertools import chain
from typing import Any

import mujoco
import numpy as np
from torch import Tensor

from ..tasks.anatomy import FREE
from ..tasks.rotations import wxyz
from ..tasks.task import Task

PREFIX = "goal of "
GHOST = (0.35, 0.95, 0.5, 0.35)
ZENITH, NADIR, HAZE = (0.30, 0.50, 0.78), (1.0, 1.0, 1.0), (0.65, 0.75, 0.89)
GROUND, TILE, SEAM = (0.36, 0.385, 0.42), (0.40, 0.425, 0.46), (0.50, 0.525, 0.56)
SHELL, JOINT, ACCENT = (0.86, 0.87, 0.88), (0.20, 0.22, 0.26), (0.93, 0.42, 0.13)
"""Colours where the model has none: ACCENT for a robot's base, then SHELL and JOINT in turn along its limbs. Loose
things are SHELL, and what does not move is JOINT."""
TILES = 3.0
"""Tiles of the ground across the diameter of the scene, roughly."""
SHADOWS = 2048
"""[pixels] of the shadow map. Software renderers spend most of their time on it and on antialiasing: at twice the size,
or with four samples a pixel, a picture takes twice as long."""
_PLAIN = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
_FLOOR = "openeureka floor"
_TEXTURE, _PLANE = mujoco.mjtTexture, mujoco.mjtGeom.mjGEOM_PLANE


def decorated(task: type[Task], ghosts: Collection[str]) -> mujoco.MjModel:
    """The task's model as pictures show it, with ghosts of these bodies."""
    spec = task.model()
    add_ghosts(spec, task, ghosts)
    low, centre, radius = _extent(spec.compile())
    _sky(spec)
    _ground(spec, low, radius)
    _light(spec, centre, radius, math.radians(task.view.azimuth))
    model = spec.compile()
    _paint(model)
    model.stat.center[:], model.stat.extent = centre, radius
    model.vis.map.shadowclip, model.vis.map.zfar, model.vis.map.znear = 1.6, 60.0, 0.02
    model.vis.map.haze = 0.6
    return model


def shown(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) bool: the geoms that a camera sees."""
    material = np.append(model.mat_rgba[:, 3], 1.0)[model.geom_matid]  # the last one is for index -1, no material
    return (model.geom_rgba[:, 3] > 0.0) & (material > 0.0) & (model.geom_group < 3)


def moving(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) bool: the visible geoms that move, by physics or by hand (mocap)."""
    bodies = (model.body_weldid != 0) | (model.body_mocapid >= 0)
    return bodies[model.geom_bodyid] & shown(model)


def corners(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> np.ndarray:
    """(8 k, 3) corners [m] of the boxes around these geoms."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
    boxes = model.geom_aabb[geoms]  # centre, half size
    local = boxes[:, None, :3] + signs * boxes[:, None, 3:]
    turned = local @ data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
    return (data.geom_xpos[geoms, None] + turned).reshape(-1, 3)


def _extent(model: mujoco.MjModel) -> tuple[float, np.ndarray, float]:
    """The lowest point [m] of the scene, and the middle (3,) [m] and radius [m] of what moves, in the default pose."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = corners(model, data, moving(model))
    if not len(found):
        return 0.0, np.zeros(3), 1.0
    low, high = found.min(axis=0), found.max(axis=0)
    solid = corners(model, data, shown(model) & (model.geom_type != int(_PLANE)))
    return float(solid[:, 2].min()), (low + high) / 2, max(0.05, float(np.linalg.norm(high - low)) / 2)


def _sky(spec: mujoco.MjSpec) -> None:
    for texture in list(spec.textures):
        if texture.type == _TEXTURE.mjTEXTURE_SKYBOX:
            spec.delete(texture)
    gradient = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    spec.add_texture(type=_TEXTURE.mjTEXTURE_SKYBOX, builtin=gradient, rgb1=ZENITH, rgb2=NADIR, width=256, height=256)
    spec.visual.rgba.haze = [*HAZE, 1.0]


def _ground(spec: mujoco.MjSpec, low: float, radius: float) -> None:
    """Endless tiles, to see speed and depth by. Without a floor of its own, a scene seems to float far above them."""
    spec.add_texture(
        name=_FLOOR,
        type=_TEXTURE.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        markrgb=SEAM,
        rgb1=GROUND,
        rgb2=TILE,
        width=512,
        height=512,
    )
    repeat = 0.5 / tile_side(radius)  # a texture is two tiles wide
    floor = spec.add_material(name=_FLOOR, texrepeat=[repeat, repeat], texuniform=True, specular=0.1, shininess=0.1)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = _FLOOR
    planes = [geom for geom in spec.worldbody.geoms if geom.type == _PLANE]
    if not planes:
        planes = [spec.worldbody.add_geom(type=_PLANE, pos=[0.0, 0.0, low - radius], contype=0, conaffinity=0)]
    for plane in planes:
        if not plane.material:
            plane.material, plane.size = _FLOOR, [0.0, 0.0, 0.1]
        plane.castshadow = False  # it would fall only on the plane itself, as specks


def tile_side(radius: float) -> float:
    """[m] of a tile of the ground around a scene of this radius [m]."""
    return 2.0 ** round(math.log2(2.0 * radius / TILES))


def _light(spec: mujoco.MjSpec, centre: np.ndarray, radius: float, azimuth: float) -> None:
    """A sun that casts shadows from above the camera's left shoulder, and a fill from the right.

    Args:
        azimuth: of the camera's direction of sight [rad].
    """
    for light in list(spec.lights):
        spec.delete(light)
    parallel: dict[str, Any] = {"type": mujoco.mjtLightType.mjLIGHT_DIRECTIONAL}
    forward, right = np.array([math.cos(azimuth), math.sin(azimuth)]), np.array([math.sin(azimuth), -math.cos(azimuth)])
    away = np.array([*(0.25 * forward + 0.35 * right), -1.0])
    filling = np.array([*(0.6 * forward - 0.6 * right), -0.35])
    place = centre - 4.0 * radius * away / np.linalg.norm(away)
    spec.worldbody.add_light(
        name="sun", pos=place, dir=away, castshadow=True, diffuse=[0.82, 0.80, 0.76], specular=[0.35] * 3, **parallel
    )
    spec.worldbody.add_light(
        pos=place, dir=filling, castshadow=False, diffuse=[0.16, 0.19, 0.24], specular=[0.0] * 3, **parallel
    )
    head = spec.visual.headlight
    head.ambient, head.diffuse, head.specular = [0.34, 0.35, 0.37], [0.16] * 3, [0.0] * 3
    spec.visual.quality.shadowsize, spec.visual.quality.offsamples = SHADOWS, 0


def _paint(model: mujoco.MjModel) -> None:
    """Give colours to what MuJoCo would draw grey."""
    plain = (model.geom_matid < 0) & np.all(np.isclose(model.geom_rgba, _PLAIN), axis=1)
    for geom in np.flatnonzero(plain):
        body = int(model.geom_bodyid[geom])
        depth, alone = _depth(model, body), not np.any(model.body_parentid == body)
        free = alone and depth == 1 and model.jnt_type[model.body_jntadr[body]] == FREE
        colour = JOINT if not depth else SHELL if free else ACCENT if depth == 1 else (SHELL, JOINT)[depth % 2]
        model.geom_rgba[geom, :3] = colour


def _depth(model: mujoco.MjModel, body: int) -> int:
    """Number of moving bodies from the world to this one, itself included; bodies welded together count as one."""
    count = 0
    while model.body_weldid[body]:
        count += int(model.body_weldid[body] == body)
        body = int(model.body_parentid[body])
    return count


# --- goals: where a task wants a body, a see-through copy of it stands ----------------------------------------------


def add_ghosts(spec: mujoco.MjSpec, task: type[Task], bodies: Collection[str]) -> None:
    """Add copies of bodies that are children of the world to a task's model; they are mocap and touch nothing."""
    if not bodies:
        return
    copies = task.model()
    # What refers to others is deleted before them: deleting a body also deletes parts that others may still name.
    lively = (copies.sensors, copies.actuators, copies.equalities, copies.excludes, copies.tendons, copies.joints)
    scenery = (copies.worldbody.geoms, copies.lights, copies.cameras)
    unwanted = [body for body in copies.worldbody.bodies if body.name not in bodies]
    for element in chain(*lively, *scenery, unwanted):
        copies.delete(element)
    for body in copies.worldbody.bodies:
        body.mocap = True
    for geom in copies.geoms:
        geom.contype, geom.conaffinity, geom.material, geom.rgba = 0, 0, "", GHOST
    spec.attach(copies, prefix=PREFIX, frame=spec.worldbody.add_frame())


def place_ghosts(model: mujoco.MjModel, data: mujoco.MjData, poses: Mapping[str, Tensor]) -> None:
    """Move the copies to the poses (N, 7) of the first world."""
    for body, pose in poses.items():
        index = model.body(PREFIX + body).mocapid[0]
        data.mocap_pos[index], data.mocap_quat[index] = pose[0, :3].numpy(), wxyz(pose[0, 3:]).numpy()
