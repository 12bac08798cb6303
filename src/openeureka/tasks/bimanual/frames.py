"""Where bodies and sites are, by sensors named like the state variables."""

from __future__ import annotations

import mujoco
import torch
from torch import Tensor

from ...sim import Simulator

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
