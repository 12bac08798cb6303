"""The CPU simulator: `mujoco.batch`, MuJoCo's own thread pool over many worlds."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
import torch
from mujoco.batch import Batch, SimulationError
from torch import Tensor

from ..cores import usable_cores
from .base import INPUT_FIELDS, MAX_SPEED, STATE_FIELDS, Simulator, derives

_CURRENT = mujoco.mjtStage.mjSTAGE_VEL


class CpuSimulator(Simulator):
    """MuJoCo in double precision with float32 mirrors of the bound fields.

    Only what is written goes back to the double state, so worlds that are merely stepped keep full precision.

    Args:
        model: compiled model, copied.
        num_worlds: N.
        threads: size of the thread pool; 0 means all cores that this process may use.
    """

    def __init__(self, model: mujoco.MjModel, num_worlds: int, threads: int = 0) -> None:
        # Warnings are counted per world; MuJoCo's own handler would write a log file into the working directory.
        mujoco.set_mju_user_warning(lambda _: None)
        self.num_worlds = num_worlds
        self.device = torch.device("cpu")
        self.bad = torch.zeros(num_worlds, dtype=torch.bool)
        # One MjData per world: updating derived fields is then the first half of the next step, and costs nothing.
        self._batch = Batch(model, num_worlds, nthread=threads or usable_cores(), persistent=True)
        self.model = self._batch.get_model(0)
        self._mirrors: dict[str, tuple[np.ndarray, Tensor]] = {}
        self._expanded: dict[str, tuple[np.ndarray, Tensor]] = {}
        self._warning, self._qvel = self._batch.warning, self._batch.bind("qvel")
        self._seen = self._warning[:, :, 1].copy()

    def bind(self, field: str) -> Tensor:
        if field not in self._mirrors:
            array = self._batch.bind(field)
            self._batch.forward()
            self._mirrors[field] = (array, _float32(array))
        return self._mirrors[field][1]

    def expand(self, field: str) -> Tensor:
        if field not in self._expanded:
            array = self._batch.expand(field)
            self._expanded[field] = (array, _float32(array))
        return self._expanded[field][1]

    def step(self, substeps: int) -> None:
        self._push_model()
        for name in INPUT_FIELDS:
            if name in self._mirrors:
                array, mirror = self._mirrors[name]
                array[:] = mirror.numpy()
        failed: list[int] = []
        playing = None if self.playing is None else _indices(self.playing)
        try:
            self._batch.step(playing, nstep=substeps, stage=_CURRENT)
        except SimulationError as error:
            failed = list(error.ids)
        self._note_bad(failed)
        self._pull()

    def reset(self, worlds: Tensor) -> None:
        ids = _indices(worlds)
        if len(ids):
            self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
            self._seen[ids] = self._warning[ids, :, 1]
            self._pull(ids)

    def forward(self, worlds: Tensor) -> None:
        ids = _indices(worlds)
        if not len(ids):
            return
        self._push_model()
        for name in (*STATE_FIELDS, *INPUT_FIELDS):
            if name in self._mirrors:
                array, mirror = self._mirrors[name]
                array[ids] = mirror.numpy()[ids]
        self._batch.forward(ids)
        self._pull(ids)

    def check(self, task: str) -> None:
        """Nothing to check: MuJoCo makes room as needed."""

    def snapshot(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        model = self._batch.get_model(world)
        data = self._batch.get_data(world)
        mujoco.mj_forward(model, data)
        return model, data

    def writable(self) -> list[Tensor]:
        bound = [mirror for name, (_, mirror) in self._mirrors.items() if name in (*STATE_FIELDS, *INPUT_FIELDS)]
        return bound + [mirror for _, mirror in self._expanded.values()]

    def memory(self) -> dict[str, Tensor]:
        fields = {f"bound/{name}": mirror for name, (_, mirror) in self._mirrors.items()}
        for name, (array, mirror) in self._expanded.items():
            fields |= {f"expanded/{name}": mirror, f"exact/{name}": torch.from_numpy(array)}
        return {"state": torch.from_numpy(self._batch.state), **fields}

    def load_state_dict(self, saved: Mapping[str, Tensor]) -> None:
        super().load_state_dict(saved)
        if self._expanded:
            self._batch.set_const()

    def _pull(self, worlds: np.ndarray | slice = slice(None)) -> None:
        for array, mirror in self._mirrors.values():
            mirror.numpy()[worlds] = array[worlds]

    def _push_model(self) -> None:
        derived = np.zeros(self.num_worlds, dtype=bool)
        for name, (array, mirror) in self._expanded.items():
            values = mirror.numpy()
            changed = (values != array.astype(np.float32)).reshape(self.num_worlds, -1).any(axis=1)
            if changed.any():
                array[changed] = values[changed]
                if derives(name):
                    derived |= changed
        if derived.any():
            self._batch.set_const(np.flatnonzero(derived))

    def _note_bad(self, failed: list[int]) -> None:
        """Compare warning counters with those last seen; MuJoCo itself resets a world whose state is not finite."""
        count = self._warning[:, :, 1]
        bad = (count > self._seen).any(axis=1)
        bad[failed] = True
        np.copyto(self._seen, count)
        fast = np.flatnonzero(np.abs(self._qvel).max(axis=1, initial=0.0) > MAX_SPEED)
        if len(fast):
            bad[fast] = True
            self._batch.reset(fast)
        self.bad.numpy()[:] = bad


def _indices(worlds: Tensor) -> np.ndarray:
    return np.flatnonzero(worlds.numpy()) if worlds.dtype == torch.bool else worlds.numpy()


def _float32(array: np.ndarray) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))
