"""Poses of bodies and sites, from sensors that are named like the state variables."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
import torch
from torch import Tensor

from ...sim import Simulator
from ...tasks.rotations import multiply, rotate, xyzw
from ...tasks.sensors import body_states
from .shapes import LINK

_SENSORS = {
    "pos": mujoco.mjtSensor.mjSENS_FRAMEPOS,
    "rot": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    "linvel": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
    "angvel": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
}


def add_body_sensors(spec: mujoco.MjSpec, body: str, name: str) -> None:
    """`{name}_pos`, `_rot`, `_linvel` and `_angvel` of a body's frame."""
    _add(spec, mujoco.mjtObj.mjOBJ_XBODY, body, name, tuple(_SENSORS))


def add_site_sensors(spec: mujoco.MjSpec, site: str) -> None:
    """`{site}_pos` and `{site}_rot`."""
    _add(spec, mujoco.mjtObj.mjOBJ_SITE, site, site, ("pos", "rot"))


def _add(spec: mujoco.MjSpec, kind: mujoco.mjtObj, frame: str, name: str, quantities: tuple[str, ...]) -> None:
    for quantity in quantities:
        spec.add_sensor(name=f"{name}_{quantity}", type=_SENSORS[quantity], objtype=kind, objname=frame)


class Frames:
    """Reads the sensors of a simulator by name, quaternions as x, y, z, w."""

    def __init__(self, sim: Simulator) -> None:
        model = sim.model
        self._readings = sim.bind("sensordata")
        order = torch.arange(model.nsensordata)
        self._columns: dict[str, slice] = {}
        for index in range(model.nsensor):
            start, size = int(model.sensor_adr[index]), int(model.sensor_dim[index])
            self._columns[model.sensor(index).name] = slice(start, start + size)
            if int(model.sensor_type[index]) == int(_SENSORS["rot"]):
                order[start : start + 4] = start + torch.tensor([1, 2, 3, 0])
        self._order = order.to(sim.device)

    def read(self) -> dict[str, Tensor]:
        """Every sensor's value (N, .), fresh; also `{name}_pose` and, of a body, `{name}_state` (N, 13)."""
        readings = self._readings.index_select(1, self._order)
        values = {name: readings[:, columns] for name, columns in self._columns.items()}
        for name, columns in self._columns.items():
            frame, _, quantity = name.rpartition("_")
            if quantity == "rot":
                values[f"{frame}_pose"] = readings[:, columns.start - 3 : columns.stop]
            if quantity == "angvel":
                values[f"{frame}_state"] = readings[:, columns.start - 10 : columns.stop]
        return values


class Bodies:
    """States of the bodies of the original: of both hands, then of each thing, a fresh (N, B, 13).

    A thing of more than one body begins with an empty base, which has the frame of the whole thing here. Then come its
    main body, in this frame turned by `LINK`, and its moving parts, turned alike, each at its joint. A part with two
    joints has two equal rows: the original has a massless body between the joints.

    Args:
        hands: bodies of both hands, which come first in the model.
        things: how many bodies each thing has in the original, by its name.
    """

    def __init__(self, sim: Simulator, hands: int, things: Mapping[str, int]) -> None:
        model = sim.model
        self._fields = [sim.bind(field) for field in ("xpos", "xquat", "cvel", "subtree_com")]
        rows, anchors, turned = list(range(1, hands + 1)), [np.zeros(3)] * hands, [False] * hands
        for name, count in things.items():
            base = int(model.body(name).id)
            parts = [joint for joint in range(model.njnt) if int(model.body_parentid[model.jnt_bodyid[joint]]) == base]
            bodies = [int(model.jnt_bodyid[joint]) for joint in parts]
            last = {int(model.jnt_bodyid[joint]): model.jnt_pos[joint] for joint in parts}
            links = [base, *bodies] if count > 1 else []
            rows += [base, *links]
            anchors += [np.zeros(3)] * min(count, 2) + [last[body] for body in bodies]
            turned += [False] + [True] * len(links)
        self._rows = torch.tensor(rows, device=sim.device)
        self._roots = torch.from_numpy(model.body_rootid).to(sim.device, torch.int64)[self._rows]
        self._anchors = torch.from_numpy(np.array(anchors)).to(sim.device, torch.float32)[hands:]
        turns = np.where(np.array(turned)[:, None], LINK, (1.0, 0.0, 0.0, 0.0))
        self._turns = xyzw(torch.from_numpy(turns).to(sim.device, torch.float32))[hands:]
        self._hands = hands

    def read(self) -> Tensor:
        """(N, B, 13)"""
        xpos, xquat, cvel, centre = self._fields
        xpos, xquat, cvel = (field.index_select(1, self._rows) for field in (xpos, xquat, cvel))
        states = body_states(xpos, xquat, cvel, centre.index_select(1, self._roots))
        pos, rot, linvel, angvel = states[:, self._hands :].split((3, 4, 3, 3), dim=-1)
        arm = rotate(rot, self._anchors)
        turned = multiply(rot, self._turns.expand_as(rot))
        things = torch.cat((pos + arm, turned, linvel + torch.linalg.cross(angvel, arm), angvel), dim=-1)
        return torch.cat((states[:, : self._hands], things), dim=1)
