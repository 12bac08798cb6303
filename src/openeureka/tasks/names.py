"""What a model's names stand for in MuJoCo's fields."""

from __future__ import annotations

import mujoco
import numpy as np
import torch
from torch import Tensor

from ..errors import TaskError, nearest
from ..sim import Simulator
from .anatomy import BALL, FREE, HINGE, SLIDE, name_of, own_joints


class Names:
    """Columns of MuJoCo's fields, found by name when a task starts.

    A number in the task's file would mean another body once the model is edited. Every method raises TaskError where
    the model has no such name.
    """

    def __init__(self, sim: Simulator) -> None:
        self._model, self._device = sim.model, sim.device

    def body(self, name: str) -> int:
        """Index of a body in `xpos`, `xquat`, `xipos`, `cvel` and all other fields of bodies."""
        return self._index("BODY", name)

    def site(self, name: str) -> int:
        """Index of a site in `site_xpos` and `site_xmat`."""
        return self._index("SITE", name)

    def geom(self, name: str) -> int:
        """Index of a geom in `geom_xpos` and `geom_xmat`."""
        return self._index("GEOM", name)

    def sensor(self, name: str) -> int | slice:
        """Columns of a sensor in `sensordata`; a single one where it measures one number."""
        sensor = self._index("SENSOR", name)
        first, size = int(self._model.sensor_adr[sensor]), int(self._model.sensor_dim[sensor])
        return first if size == 1 else slice(first, first + size)

    def joints(self, names: tuple[str, ...]) -> tuple[Tensor, Tensor]:
        """Columns (k,) of hinges and slides in `qpos` and in `qvel`."""
        joints = [self._joint(name, (HINGE, SLIDE), "hinge or slide") for name in names]
        places, dofs = self._model.jnt_qposadr[joints], self._model.jnt_dofadr[joints]
        return self._columns(places), self._columns(dofs)

    def ball(self, name: str) -> tuple[slice, slice]:
        """Columns of a ball joint: in `qpos` its quaternion w, x, y, z, and in `qvel` its angular velocity."""
        joint = self._joint(name, (BALL,), "ball joint")
        place, dof = int(self._model.jnt_qposadr[joint]), int(self._model.jnt_dofadr[joint])
        return slice(place, place + 4), slice(dof, dof + 3)

    def free(self, body: str) -> tuple[slice, slice]:
        """Columns of a body on a free joint in `qvel`: velocity in the world frame, angular velocity in its own."""
        joints = [j for j in own_joints(self._model, self.body(body)) if self._model.jnt_type[j] == FREE]
        if not joints:
            raise TaskError(f"The body `{body}` has no free joint; add <freejoint/> to it, or name its joints.")
        dof = int(self._model.jnt_dofadr[joints[0]])
        return slice(dof, dof + 3), slice(dof + 3, dof + 6)

    def _columns(self, numbers: np.ndarray) -> Tensor:
        return torch.as_tensor(numbers, dtype=torch.int64, device=self._device)

    def _joint(self, name: str, kinds: tuple[int, ...], wanted: str) -> int:
        joint = self._index("JOINT", name)
        if self._model.jnt_type[joint] not in kinds:
            raise TaskError(f"The joint `{name}` of the model is not a {wanted}, but the task reads it as one.")
        return joint

    def _index(self, kind: str, name: str) -> int:
        found = mujoco.mj_name2id(self._model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), name)
        if found >= 0:
            return found
        count = {"BODY": "nbody", "SITE": "nsite", "GEOM": "ngeom", "SENSOR": "nsensor", "JOINT": "njnt"}[kind]
        has = [known for i in range(getattr(self._model, count)) if (known := name_of(self._model, kind, i))]
        meant = nearest(name, has) or (f" It has {', '.join(has)}." if has else "")
        raise TaskError(f"The model has no {kind.lower()} `{name}`, which the task names.{meant}")
