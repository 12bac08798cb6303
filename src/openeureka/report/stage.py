"""One world of a task under a policy, on a stage made for looking at: what videos and viewers show."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain

import mujoco
import numpy as np
import torch
from torch import Tensor

from ..tasks import registry
from ..tasks.rotations import wxyz
from ..tasks.task import Task
from ..training.policy import Player, Policy
from .camera import camera

Agent = Callable[[Tensor], Tensor]
PREFIX = "goal of "
COLOUR = (0.3, 0.85, 0.4, 0.4)


class Play:
    """One world under a policy; `step` plays on, across episodes.

    Args:
        agent: `random`, `zero` or a policy's safetensors bytes.

    Attributes:
        dt: [s] of a step.

    Raises:
        RewardFileError: when the policy is for another task.
    """

    def __init__(self, env: str, agent: str | bytes, seed: int) -> None:
        self._agent = _agent(env, agent, seed)
        self._simulation = registry.make(env, worlds=1, lane_seeds=(seed,), threads=1)
        self._simulation.scored = False  # a task can be watched before its F is written
        self._observation = self._simulation.reset()
        self.dt = self._simulation.task.control_dt

    def step(self) -> None:
        """One control step."""
        self._observation = self._simulation.step(self._agent(self._observation)).observation


class Stage(Play):
    """The world as it is now in `data`, a copy that may be drawn at leisure."""

    def __init__(self, env: str, agent: str | bytes, seed: int) -> None:
        super().__init__(env, agent, seed)
        task = self._simulation.task
        self.model = decorated(type(task), task.ghosts())
        self.data = mujoco.MjData(self.model)
        self._copy()
        self.camera = camera(self.model, self.data, task.view)

    def step(self) -> None:
        super().step()
        self._copy()

    @contextmanager
    def painter(self, width: int, height: int) -> Iterator[Callable[[], np.ndarray]]:
        """A function that draws what is now, (height, width, 3) uint8."""
        with mujoco.Renderer(self.model, height, width) as renderer:

            def paint() -> np.ndarray:
                renderer.update_scene(self.data, self.camera)
                return renderer.render()

            yield paint

    def _copy(self) -> None:
        _, data = self._simulation.sim.snapshot(0)
        own = slice(len(data.mocap_pos))
        self.data.qpos[:], self.data.mocap_pos[own], self.data.mocap_quat[own] = (
            data.qpos,
            data.mocap_pos,
            data.mocap_quat,
        )
        place_ghosts(self.model, self.data, self._simulation.task.ghosts())
        mujoco.mj_forward(self.model, self.data)


def _agent(env: str, kind: str | bytes, seed: int) -> Agent:
    actions = registry.get(env).num_actions
    if isinstance(kind, bytes):
        policy = Policy.from_bytes(kind)
        policy.expect(registry.get(env).num_observations, actions)
        return Player([policy])
    if kind == "random":
        generator = torch.Generator().manual_seed(seed)
        return lambda observation: torch.rand(len(observation), actions, generator=generator) * 2 - 1
    return lambda observation: torch.zeros(len(observation), actions)


def decorated(task: type[Task], ghosts: Collection[str]) -> mujoco.MjModel:
    """The task's model with a sky, light, a chequered floor to see speed by, and ghosts of these bodies; training needs
    none of them."""
    spec = task.model()
    add_ghosts(spec, task, ghosts)
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


# --- goals: where a task wants a body, a see-through copy of it stands ----------------------------------------------


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
