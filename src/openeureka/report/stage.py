"""One world of a task under a policy, on a stage made for looking at: what videos and viewers show."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import torch
from torch import Tensor

from ..tasks import registry
from ..tasks.task import Task
from ..training.policy import Player, Policy

Agent = Callable[[Tensor], Tensor]


class Stage:
    """The world as it is now in `data`, a copy that may be drawn at leisure; `step` plays on, across episodes.

    Args:
        agent: `random`, `zero` or a policy's safetensors bytes.
    """

    def __init__(self, env: str, agent: str | bytes, seed: int) -> None:
        self._agent = _agent(env, agent, seed)
        self._simulation = registry.make(env, worlds=1, lane_seeds=(seed,), threads=1)
        self._observation = self._simulation.reset()
        self.model = decorated(registry.get(env))
        self.data = mujoco.MjData(self.model)
        self.dt = self._simulation.task.control_dt
        self._copy()

    def step(self) -> None:
        """One control step."""
        self._observation = self._simulation.step(self._agent(self._observation)).observation
        self._copy()

    def _copy(self) -> None:
        _, data = self._simulation.sim.snapshot(0)
        self.data.qpos[:], self.data.mocap_pos[:], self.data.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
        mujoco.mj_forward(self.model, self.data)


def _agent(env: str, kind: str | bytes, seed: int) -> Agent:
    actions = registry.get(env).num_actions
    if isinstance(kind, bytes):
        return Player([Policy.from_bytes(kind)])
    if kind == "random":
        generator = torch.Generator().manual_seed(seed)
        return lambda observation: torch.rand(len(observation), actions, generator=generator) * 2 - 1
    return lambda observation: torch.zeros(len(observation), actions)


def decorated(task: type[Task]) -> mujoco.MjModel:
    """The task's model with a sky, light and a chequered floor to see speed by; training needs none of them."""
    spec = task.model()
    sky = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, "width": 256, "height": 256}
    spec.add_texture(type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, rgb1=[0.75, 0.85, 0.95], rgb2=[0.3, 0.45, 0.65], **sky)
    squares = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_CHECKER, "width": 256, "height": 256}
    grey = {"rgb1": [0.42, 0.44, 0.46], "rgb2": [0.5, 0.52, 0.54]}
    spec.add_texture(name="floor", type=mujoco.mjtTexture.mjTEXTURE_2D, **squares, **grey)
    floor = spec.add_material(name="floor", texrepeat=[0.5, 0.5], texuniform=True)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    for geom in spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE and not geom.material:
            geom.material = "floor"
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.55] * 3
    # Software renderers spend most of their time on large shadow maps and on antialiasing: this is six times faster.
    spec.visual.quality.shadowsize, spec.visual.quality.offsamples = 1024, 0
    return spec.compile()


def camera(model: mujoco.MjModel) -> mujoco.MjvCamera:
    """The task's own camera; else follows the first body that moves freely, or shows the whole scene from its side."""
    view = mujoco.MjvCamera()
    if model.ncam:
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
        return view
    mujoco.mjv_defaultFreeCamera(model, view)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if len(free):
        root = int(model.jnt_bodyid[free[0]])
        members = np.flatnonzero(model.body_rootid == root)
        extent = float(np.linalg.norm(data.xpos[members] - data.xpos[root], axis=-1).max())
        view.type, view.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, root
        view.distance = 4.0 * max(extent, 0.4)  # [m]
        view.azimuth = 120.0
    else:
        width = _extents(model, data)
        view.azimuth = 160.0 if width[1] >= width[0] else 110.0
        view.distance = 1.1 * float(width.max())
    view.elevation = -15.0
    return view


def _extents(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(3,) size [m] of the box around everything but planes, which have no end."""
    solid = model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    half = np.abs(data.geom_xmat[solid].reshape(-1, 3, 3)) @ model.geom_aabb[solid, 3:, None]
    low, high = data.geom_xpos[solid] - half[..., 0], data.geom_xpos[solid] + half[..., 0]
    return high.max(axis=0) - low.min(axis=0)
