"""Where a task is looked at from."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from ..tasks.anatomy import FREE, HINGE, SLIDE
from ..tasks.task import View

ASPECT = 4 / 3  # of the pictures that everything fits into
_POSES = 30
_SMALL = 0.15  # of half the picture
_ROOM = 1.5  # around what is followed, so that it is seen to move
_TRAVELS = (FREE, SLIDE)


def camera(model: mujoco.MjModel, data: mujoco.MjData, view: View) -> mujoco.MjvCamera:
    """The model's first camera that has all in sight that moves; else one made so, which follows a robot that can go
    away.

    Args:
        data: the scene as it is at the start.
        view: direction of sight.
    """
    eye = mujoco.MjvCamera()
    start = _corners(model, data)
    corners = np.concatenate([start, *_swept(model, data)]) if view.swept else start
    own = next((camera for camera in range(model.ncam) if _frames(model, data, camera, start, corners)), None)
    if own is not None:
        eye.type, eye.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, own
        return eye
    mujoco.mjv_defaultFreeCamera(model, eye)
    eye.lookat[:] = (corners.min(axis=0) + corners.max(axis=0)) / 2
    eye.azimuth, eye.elevation = view.azimuth, view.elevation
    eye.distance = _fitting(corners - eye.lookat, eye, float(model.vis.global_.fovy))
    traveller = _traveller(model)
    if traveller is not None:
        eye.type, eye.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, traveller
        eye.distance *= _ROOM
    return eye


def _frames(model: mujoco.MjModel, data: mujoco.MjData, camera: int, start: np.ndarray, corners: np.ndarray) -> bool:
    """Whether a camera of the model has all in sight that moves, at the start (k, 3), where it is seen to move, and not
    too small, wherever it comes (n, 3).

    One that is fixed to a robot looks where the robot does: only those that follow it from a constant direction count.
    """
    following = (mujoco.mjtCamLight.mjCAMLIGHT_TRACK, mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM)
    if model.body_weldid[model.cam_bodyid[camera]] and model.cam_mode[camera] not in map(int, following):
        return False
    if not len(start) or model.cam_projection[camera]:
        return False
    half = math.tan(math.radians(model.cam_fovy[camera]) / 2)

    def furthest(points: np.ndarray) -> float:
        """From the middle of the picture, whose edge is at 1."""
        right, up, back = ((points - data.cam_xpos[camera]) @ data.cam_xmat[camera].reshape(3, 3)).T
        if back.max() >= 0.0:
            return math.inf
        return float((np.maximum(np.abs(right) / ASPECT, np.abs(up)) / (-back * half)).max())

    return furthest(start) <= 1.0 and furthest(corners) >= _SMALL


def _swept(model: mujoco.MjModel, data: mujoco.MjData) -> list[np.ndarray]:
    """The corners in random positions of the joints that have a range; what lies about stays where it is."""
    other, random, found = mujoco.MjData(model), np.random.default_rng(0), []
    limited = np.flatnonzero(model.jnt_limited & np.isin(model.jnt_type, (HINGE, SLIDE)))
    low, high = model.jnt_range[limited].T
    for _ in range(_POSES):
        other.qpos, other.mocap_pos, other.mocap_quat = data.qpos, data.mocap_pos, data.mocap_quat
        other.qpos[model.jnt_qposadr[limited]] = random.uniform(low, high)
        mujoco.mj_kinematics(model, other)
        found.append(_corners(model, other))
    return found


def _corners(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(8 k, 3) corners [m] of the boxes around every geom that moves, or that is moved by hand."""
    moving = (model.body_weldid != 0) | (model.body_mocapid >= 0)
    shown = moving[model.geom_bodyid]
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
    boxes = model.geom_aabb[shown]  # centre, half size
    local = boxes[:, None, :3] + signs * boxes[:, None, 3:]
    turned = local @ data.geom_xmat[shown].reshape(-1, 3, 3).transpose(0, 2, 1)
    return (data.geom_xpos[shown, None] + turned).reshape(-1, 3)


def _fitting(points: np.ndarray, eye: mujoco.MjvCamera, fovy: float) -> float:
    """Distance [m] at which a camera that looks at the origin has all points (k, 3) in sight; fovy [degrees]."""
    azimuth, elevation = math.radians(eye.azimuth), math.radians(eye.elevation)
    forward = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    half = math.tan(math.radians(fovy) / 2)
    across = np.abs(points @ right) / (half * ASPECT)
    upright = np.abs(points @ np.cross(right, forward)) / half
    return float((np.maximum(across, upright) - points @ forward).max())


def _traveller(model: mujoco.MjModel) -> int | None:
    """The body that carries all driven joints, if there is one and it can leave its place."""
    by_joint = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    roots = {_root(model, int(model.jnt_bodyid[joint])) for joint in model.actuator_trnid[by_joint, 0]}
    if len(roots) != 1:
        return None
    root = roots.pop()
    return root if model.jnt_type[model.body_jntadr[root]] in _TRAVELS else None


def _root(model: mujoco.MjModel, body: int) -> int:
    """The outermost moving body of those that a moving body hangs on, itself included."""
    while model.body_weldid[parent := int(model.body_parentid[body])]:
        body = parent
    return body
