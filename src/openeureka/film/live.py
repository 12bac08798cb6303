"""The child process behind 3-D on the page: plays a policy in real time, and tells the poses of what is drawn.

It answers the request `frame` with these poses. Other requests change the world: push, scale or restart it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import torch

from ..errors import EurekaError, told
from ..sim.perturb import Perturbed
from ..tasks.faults import fault
from ..worker import Channel
from .looks import GROUND, HAZE, SEAM, TILE, shown, tile_side
from .stage import Stage

LATE = 0.2
"""[s] by which the play may fall behind the clock before it gives up catching up."""
FACTORS = ("mass", "friction")


class Live(Stage):
    """A stage whose world a person can change."""

    def __init__(self, env: str, policy: bytes) -> None:
        super().__init__(env, policy, seed=0)
        self._physics = Perturbed(self._simulation.sim, FACTORS)
        self._velocity = self._simulation.sim.bind("qvel")
        self._all = torch.ones(1, dtype=torch.bool)
        self._drawn: list[int] = np.flatnonzero(shown(self.model)).tolist()

    def scale(self, mass: float, friction: float) -> None:
        """Set the mass of every body and the friction of every contact, as multiples of the task's own."""
        self._physics.write({"mass": torch.tensor([mass]), "friction": torch.tensor([friction])}, self._all)
        self._simulation.sim.forward(self._all)

    def push(self, speed: float, angle: float) -> None:
        """Give the heaviest thing that moves an impulse.

        Args:
            speed: [m/s] that the impulse would give its whole mass, moving freely.
            angle: [rad] of the push: 0 is away from the camera, a quarter turn is to the camera's left.
        """
        model, data = self._simulation.sim.snapshot(0)
        roots = [body for body in range(1, model.nbody) if _is_root(model, body)]
        body = max(roots, key=lambda body: model.body_subtreemass[body])
        towards = np.radians(self.camera.azimuth) + angle
        impulse = model.body_subtreemass[body] * speed * np.array([np.cos(towards), np.sin(towards), 0.0])
        jacobian, change = np.zeros((3, model.nv)), np.zeros((1, model.nv))
        mujoco.mj_jacBodyCom(model, data, jacobian, None, body)
        mujoco.mj_solveM(model, data, change, (jacobian.T @ impulse)[None])
        self._velocity[0] += torch.as_tensor(change[0], dtype=torch.float32)
        self._simulation.sim.forward(self._all)

    def restart(self) -> None:
        """Begin an episode anew."""
        self._observation = self._simulation.reset()
        self._copy()

    def scene(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """What is drawn: geoms with sizes and colours; meshes as blobs `vertices N` float32 and `faces N` uint32."""
        model = self.model
        meshes = sorted({int(model.geom_dataid[geom]) for geom in self._drawn if self._is_mesh(geom)})
        blobs: dict[str, bytes] = {}
        for place, mesh in enumerate(meshes):
            vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
            faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
            blobs[f"vertices {place}"] = model.mesh_vert[vertices].astype(np.float32).tobytes()
            blobs[f"faces {place}"] = model.mesh_face[faces].astype(np.uint32).tobytes()
        geoms = [
            {
                "type": mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower(),
                "size": model.geom_size[geom].tolist(),
                "colour": self._colour(geom),
                "lettered": bool(model.geom_matid[geom] >= 0 and (model.mat_texid[model.geom_matid[geom]] >= 0).any()),
                "mesh": meshes.index(int(model.geom_dataid[geom])) if self._is_mesh(geom) else -1,
            }
            for geom in self._drawn
        ]
        radius = float(model.stat.extent)
        floor = {"ground": GROUND, "tile": TILE, "seam": SEAM, "haze": HAZE, "side": tile_side(radius)}
        eye = {"azimuth": self.camera.azimuth, "elevation": self.camera.elevation, "fovy": model.vis.global_.fovy}
        sun = model.light_dir[0].tolist()
        return {"geoms": geoms, "meshes": len(meshes), "radius": radius, "floor": floor, "eye": eye, "sun": sun}, blobs

    def frame(self) -> bytes:
        """(1 + k, 12) float32: the point looked at and its distance, then position and rotation of every geom."""
        head = np.zeros((1, 12), np.float32)
        head[0, :4] = *self.camera.lookat, self.camera.distance
        poses = np.concatenate([self.data.geom_xpos[self._drawn], self.data.geom_xmat[self._drawn]], axis=1)
        return np.concatenate([head, poses.astype(np.float32)]).tobytes()

    def _is_mesh(self, geom: int) -> bool:
        return int(self.model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_MESH)

    def _colour(self, geom: int) -> list[float]:
        """The colour in which MuJoCo draws a geom: that of its material, unless the geom has its own."""
        own, material = self.model.geom_rgba[geom], int(self.model.geom_matid[geom])
        plain = material >= 0 and np.allclose(own, (0.5, 0.5, 0.5, 1.0))
        return (self.model.mat_rgba[material] if plain else own).tolist()


def _is_root(model: mujoco.MjModel, body: int) -> bool:
    """Whether the body moves, and its parent does not."""
    return bool(model.body_weldid[body]) and not model.body_weldid[model.body_parentid[body]]


def _obey(channel: Channel, stage: Live, said: Mapping[str, Any]) -> None:
    match said["do"]:
        case "frame":
            channel.send({}, {"frame": stage.frame()})
        case "push":
            stage.push(said["speed"], said["angle"])
        case "scale":
            stage.scale(said["mass"], said["friction"])
        case _:
            stage.restart()


def _play(channel: Channel, stage: Live) -> None:
    due = time.monotonic()
    while True:
        while channel.ready():
            asked = channel.receive()
            if asked is None:
                return
            _obey(channel, stage, asked.header)
        now = time.monotonic()
        if now < due:
            time.sleep(min(due - now, 0.005))
            continue
        due = max(due + stage.dt, now - LATE)
        stage.step()


def main() -> None:
    torch.set_num_threads(1)
    channel = Channel()
    request = channel.receive()
    if request is None:
        return
    try:
        stage = Live(request.header["env"], request.blobs["policy"])
        channel.send(*stage.scene())
        _play(channel, stage)
    except EurekaError as error:
        channel.send({"refused": str(error)})
    except Exception as error:
        channel.send({"refused": str(fault(error) or f"The policy cannot be played: {told(error)}")})


if __name__ == "__main__":
    main()
