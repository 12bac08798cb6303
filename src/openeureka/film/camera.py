"""The camera: where it looks at a task from, and how it follows what happens."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from ..tasks.anatomy import FREE, HINGE, SLIDE
from ..tasks.task import View
from .looks import corners, moving

ASPECT = 16 / 9  # width over height of pictures that say no other
_POSES = 30
_SMALL = 0.15  # share of half the picture
MARGIN = 1.12
"""Distance of the camera, as a multiple of that from which everything just fits."""
AIR = 1.02
"""The least such multiple while the camera lags behind: what touches the edge looks cut off."""
EASE, ZOOM = 0.35, 1.5
"""[s] Time constants with which the camera catches up, and zooms where that is not needed at once."""
FURTHEST = 1.8
"""Largest multiple of the distance at the start: what a fixed robot drops or throws must not make all else small."""
_TRAVELS = (FREE, SLIDE)


class Camera:
    """Looks at a task from its `view`, and keeps what moves in sight.

    If a camera of the model has everything in sight, the first such camera is used instead, as it is. The camera goes
    along with a robot that can travel. It follows nothing that a robot throws.

    Args:
        data: the scene as it is at the start.
        view: direction of sight.
        aspect: width of the picture over its height.

    Attributes:
        eye: the camera as MuJoCo has it.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, view: View, aspect: float = ASPECT) -> None:
        self.eye = mujoco.MjvCamera()
        self._model, self._aspect = model, aspect
        self._geoms = moving(model)
        start = corners(model, data, self._geoms)
        everything = np.concatenate([start, *self._swept(data)]) if view.swept else start
        own = next((camera for camera in range(model.ncam) if self._frames(data, camera, start, everything)), None)
        self._fixed = own is not None
        if own is not None:
            self.eye.type, self.eye.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, own
            return
        mujoco.mjv_defaultFreeCamera(model, self.eye)
        self.eye.azimuth, self.eye.elevation = view.azimuth, view.elevation
        traveller = _traveller(model)
        self._fixed = not len(start)
        if self._fixed:
            return
        self._still = everything if traveller is None else start[:0]  # stays in sight whatever happens
        self._furthest = math.inf
        self._look(everything, 0.0)
        self._furthest = FURTHEST * self.eye.distance if traveller is None else math.inf

    def follow(self, data: mujoco.MjData, seconds: float) -> None:
        """Look at the scene as it is now, `seconds` after the last look. Where it has jumped, the camera jumps too."""
        if not self._fixed:
            now = corners(self._model, data, self._geoms)
            self._look(np.concatenate([now, self._still]), seconds)

    def hand_over(self) -> mujoco.MjvCamera:
        """The camera for a person to turn. From now on it goes along with a robot that travels, and nothing else."""
        traveller = None if self._fixed else _traveller(self._model)
        self._fixed = True
        if traveller is not None:
            self.eye.type, self.eye.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, traveller
        return self.eye

    def sees(self, data: mujoco.MjData) -> float:
        """The distance from which what moves would just fit, over the camera's distance: above 1, the edge cuts it.

        0 where the camera is fixed.
        """
        if self._fixed:
            return 0.0
        return self._fitting(corners(self._model, data, self._geoms) - self.eye.lookat) / self.eye.distance

    def _look(self, points: np.ndarray, seconds: float) -> None:
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        eye, lag = self.eye, middle - self.eye.lookat
        cut = not seconds or np.linalg.norm(lag) > 0.5 * eye.distance
        eye.lookat[:] = middle if cut else eye.lookat + lag * (1.0 - math.exp(-seconds / EASE))
        needed = self._fitting(points - eye.lookat)
        wanted = min(MARGIN * needed, self._furthest)
        if cut:
            eye.distance = wanted
            return
        eased = eye.distance + (wanted - eye.distance) * (1.0 - math.exp(-seconds / ZOOM))
        eye.distance = max(eased, min(AIR * needed, self._furthest))

    def _axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forward, right and up of the camera, unit vectors (3,) in the world frame."""
        azimuth, elevation = math.radians(self.eye.azimuth), math.radians(self.eye.elevation)
        forward = np.array(
            [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
        )
        right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
        return forward, right, np.cross(right, forward)

    def _fitting(self, points: np.ndarray) -> float:
        """Distance [m] at which all points (k, 3), relative to the point looked at, are in sight."""
        forward, right, up = self._axes()
        half = math.tan(math.radians(self._model.vis.global_.fovy) / 2)
        across, upright = np.abs(points @ right) / (half * self._aspect), np.abs(points @ up) / half
        return float((np.maximum(across, upright) - points @ forward).max())

    def _frames(self, data: mujoco.MjData, camera: int, start: np.ndarray, everything: np.ndarray) -> bool:
        """Whether a camera of the model has in sight what moves.

        At the start all of it (k, 3) must be in the picture, and the places that it may come to (n, 3) must not look
        too small. A camera that turns with a robot does not count, unlike one that follows from a constant direction.
        """
        model = self._model
        following = (mujoco.mjtCamLight.mjCAMLIGHT_TRACK, mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM)
        if model.body_weldid[model.cam_bodyid[camera]] and model.cam_mode[camera] not in map(int, following):
            return False
        if not len(start) or model.cam_projection[camera]:
            return False
        half = math.tan(math.radians(model.cam_fovy[camera]) / 2)

        def furthest(points: np.ndarray) -> float:
            """The largest distance from the middle of the picture, whose edge is at 1."""
            right, up, back = ((points - data.cam_xpos[camera]) @ data.cam_xmat[camera].reshape(3, 3)).T
            if back.max() >= 0.0:
                return math.inf
            return float((np.maximum(np.abs(right) / self._aspect, np.abs(up)) / (-back * half)).max())

        return furthest(start) <= 1.0 and furthest(everything) >= _SMALL

    def _swept(self, data: mujoco.MjData) -> list[np.ndarray]:
        """The corners for random positions of the joints that have a range; loose objects stay where they are."""
        model, other, random, found = self._model, mujoco.MjData(self._model), np.random.default_rng(0), []
        limited = np.flatnonzero(model.jnt_limited & np.isin(model.jnt_type, (HINGE, SLIDE)))
        low, high = model.jnt_range[limited].T
        for _ in range(_POSES):
            other.qpos, other.mocap_pos, other.mocap_quat = data.qpos, data.mocap_pos, data.mocap_quat
            other.qpos[model.jnt_qposadr[limited]] = random.uniform(low, high)
            mujoco.mj_kinematics(model, other)
            found.append(corners(model, other, self._geoms))
        return found


def _traveller(model: mujoco.MjModel) -> int | None:
    """The body that carries all driven joints, if there is one and it can leave its place."""
    by_joint = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    roots = {_root(model, int(model.jnt_bodyid[joint])) for joint in model.actuator_trnid[by_joint, 0]}
    if len(roots) != 1:
        return None
    root = roots.pop()
    return root if model.jnt_type[model.body_jntadr[root]] in _TRAVELS else None


def _root(model: mujoco.MjModel, body: int) -> int:
    """The outermost moving body in the chain of parents of a moving body, which may be itself."""
    while model.body_weldid[parent := int(model.body_parentid[body])]:
        body = parent
    return body
