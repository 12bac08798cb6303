"""The child process behind `report.video`: plays a policy in one world and encodes what the camera sees.

The parent sets MUJOCO_GL, which MuJoCo reads when it is imported.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import imageio_ffmpeg
import mujoco
import numpy as np
import torch
from torch import Tensor

from ..errors import EurekaError
from ..tasks import registry
from ..tasks.task import Task
from ..training.policy import Player, Policy
from ..worker import Channel

WIDTH, HEIGHT = 640, 480
FPS = 30

Agent = Callable[[Tensor], Tensor]


def frames(env: str, agent: Agent, seconds: float, seed: int) -> Iterator[np.ndarray]:
    """(HEIGHT, WIDTH, 3) uint8 images of one world, FPS a second of simulated time, across episodes."""
    simulation = registry.make(env, worlds=1, lane_seeds=(seed,), threads=1)
    observation = simulation.reset()
    stage = _stage(registry.get(env))
    shown = mujoco.MjData(stage)
    camera = _camera(stage)
    dt = simulation.task.control_dt
    with mujoco.Renderer(stage, HEIGHT, WIDTH) as renderer:
        count = 0
        for step in range(max(1, round(seconds / dt))):
            if step * dt * FPS >= count:
                _, data = simulation.sim.snapshot(0)
                shown.qpos[:], shown.mocap_pos[:], shown.mocap_quat[:] = data.qpos, data.mocap_pos, data.mocap_quat
                mujoco.mj_forward(stage, shown)
                renderer.update_scene(shown, camera)
                yield renderer.render()
                count += 1
            observation = simulation.step(agent(observation)).observation


def encode(images: Iterator[np.ndarray]) -> bytes:
    """An mp4 (H.264) of the images; ffmpeg comes with the imageio-ffmpeg wheel."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        writer = imageio_ffmpeg.write_frames(str(path), (WIDTH, HEIGHT), fps=FPS, quality=7, macro_block_size=1)
        writer.send(None)
        for image in images:
            writer.send(np.ascontiguousarray(image))
        writer.close()
        return path.read_bytes()


def _stage(task: type[Task]) -> mujoco.MjModel:
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


def _camera(model: mujoco.MjModel) -> mujoco.MjvCamera:
    """The task's own camera; else follows the first body that moves freely, or shows the whole scene from its side."""
    camera = mujoco.MjvCamera()
    if model.ncam:
        camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
        return camera
    mujoco.mjv_defaultFreeCamera(model, camera)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    if len(free):
        root = int(model.jnt_bodyid[free[0]])
        members = np.flatnonzero(model.body_rootid == root)
        extent = float(np.linalg.norm(data.xpos[members] - data.xpos[root], axis=-1).max())
        camera.type, camera.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, root
        camera.distance = 4.0 * max(extent, 0.4)  # [m]
        camera.azimuth = 120.0
    else:
        width = _extents(model, data)
        camera.azimuth = 160.0 if width[1] >= width[0] else 110.0
        camera.distance = 1.1 * float(width.max())
    camera.elevation = -15.0
    return camera


def _extents(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(3,) size [m] of the box around everything but planes, which have no end."""
    solid = model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    half = np.abs(data.geom_xmat[solid].reshape(-1, 3, 3)) @ model.geom_aabb[solid, 3:, None]
    low, high = data.geom_xpos[solid] - half[..., 0], data.geom_xpos[solid] + half[..., 0]
    return high.max(axis=0) - low.min(axis=0)


def _agent(kind: str, env: str, policy: bytes, seed: int) -> Agent:
    actions = registry.get(env).num_actions
    if kind == "random":
        generator = torch.Generator().manual_seed(seed)
        return lambda observation: torch.rand(len(observation), actions, generator=generator) * 2 - 1
    if kind == "zero":
        return lambda observation: torch.zeros(len(observation), actions)
    return Player([Policy.from_bytes(policy)])


def _try_renderer() -> None:
    """Renders one empty scene; dies where there is no OpenGL."""
    with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16) as renderer:
        renderer.render()


def main() -> None:
    channel = Channel()
    request = channel.receive()
    if request is None:
        return
    _try_renderer()
    wanted = request.header
    if wanted["agent"] == "none":
        channel.send({})
        return
    try:
        agent = _agent(wanted["agent"], wanted["env"], request.blobs.get("policy", b""), wanted["seed"])
        video = encode(frames(wanted["env"], agent, wanted["seconds"], wanted["seed"]))
    except EurekaError as error:
        channel.send({"refused": str(error)})
    else:
        channel.send({}, {"video": video})


if __name__ == "__main__":
    main()
