"""The GPU simulator: `mujoco_warp`, MuJoCo in single precision with one thread block per world.

It also runs on the CPU (`device=warp-cpu`), far slower than `cpu.py`, so that the two can be compared without a GPU.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from operator import attrgetter

import mujoco
import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import numpy as np
import torch
import warp as wp  # pyright: ignore[reportMissingImports]
from torch import Tensor

from ..errors import CapacityError
from .base import INPUT_FIELDS, MAX_SPEED, Capacity, Simulator, aligned, derives

wp.config.log_level = wp.LOG_WARNING  # else a line for every kernel loaded

LIMITS = {"qpos": 1e10, "qvel": MAX_SPEED, "ctrl": 1e10}  # clamping to an actuator's range may hide a NaN in ctrl
"""Magnitudes above which a world is bad; MuJoCo's own limit is 1e10."""
_STATE = ("time", "qpos", "qvel", "act")
_MEMORY = (*_STATE, "act_dot", "qacc", "qacc_warmstart", "userdata", "sensordata", *INPUT_FIELDS)
"""Fields that `reset` writes: all that a step reads from the step before."""
# What mj_setConst derives from the fields that a task may vary between worlds.
_DERIVED = (
    "body_subtreemass",
    "body_invweight0",
    "dof_invweight0",
    "tendon_invweight0",
    "tendon_length0",
    "actuator_acc0",
)
_OVERFLOWS = {
    "max_constraints": mjw.OverflowType.NEFC | mjw.OverflowType.NJMAX_NNZ,
    "max_contacts": mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE | mjw.OverflowType.CONTACT_MATCH,
}


class WarpSimulator(Simulator):
    """MuJoCo Warp; bound fields are the simulator's own memory.

    A control step is a single launch of a CUDA graph. Nothing waits for the device except for `bind` and `expand`,
    which a task calls once, `check` and `snapshot`.

    Args:
        model: compiled model.
        num_worlds: N.
        device: warp's name of the device: `cpu`, `cuda:0`, ...
        capacity: room for contacts and constraints.
    """

    def __init__(self, model: mujoco.MjModel, num_worlds: int, device: str, capacity: Capacity) -> None:
        self.model, self.num_worlds, self.capacity = model, num_worlds, capacity
        self._device = wp.get_device(device)
        self.device = torch.device(device)
        self._plain = mujoco.MjData(model)
        self._moving_anchors = bool(np.isin(model.eq_type, (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)).any())
        with wp.ScopedDevice(self._device):
            self._model = mjw.put_model(model)
            self._data = mjw.make_data(model, nworld=num_worlds, nconmax=capacity.contacts, njmax=capacity.constraints)
            # Boxes then collide by code of their own, as in MuJoCo; native CCD finds fewer contacts of an edge.
            self._model.opt.disableflags |= mjw.DisableBit.NATIVECCD
            self._model.opt.warn_overflow = 0  # `check` says it once, instead of every world on every step
            late = np.repeat(model.sensor_needstage == mujoco.mjtStage.mjSTAGE_ACC, model.sensor_dim)
            self._late = wp.array(late, dtype=bool)
            self._kept = wp.zeros_like(self._data.sensordata)
        self.bad = torch.zeros(num_worlds, dtype=torch.bool, device=self.device)
        self._bound: dict[str, Tensor] = {}
        self._flags: dict[str, Tensor] = {}
        self._expanded: dict[str, tuple[Tensor, int]] = {}
        self._defaults = {name: (self._tensor(name), self._default(name)) for name in _MEMORY}
        self._graphs: dict[int, wp.Graph] = {}
        # Kernels are compiled and loaded here: while a graph is recorded they cannot be.
        self._run(1)
        self._run(0)
        everywhere = torch.ones(num_worlds, dtype=torch.bool, device=self.device)
        self.reset(everywhere)
        self.forward(everywhere)

    def bind(self, field: str) -> Tensor:
        if field not in self._bound:
            tensor = self._tensor(field)
            if tensor.dtype != torch.float32:
                self._flags[field], tensor = tensor, tensor.to(torch.float32)
            self._bound[field] = tensor
        return self._bound[field]

    def expand(self, field: str) -> Tensor:
        if field not in self._expanded:
            for name in (field, *_DERIVED):
                self._widen(name)
            self._graphs.clear()  # they hold the addresses of the old arrays
            values = wp.to_torch(attrgetter(field)(self._model))
            values = values.view(self.num_worlds, *np.shape(attrgetter(field)(self.model)))
            self._expanded[field] = (values, values._version)
        return self._expanded[field][0]

    def step(self, substeps: int) -> None:
        self._push()
        self._launch(substeps)
        self._note_bad()
        # As in MuJoCo, so that a bad world's numbers spoil no sum; derived fields follow when the caller resets it.
        for name in (*_STATE, "qacc_warmstart", "sensordata"):
            _put(self._defaults[name][0], self.bad, self._defaults[name][1])
        for name, tensor in self._bound.items():
            if name not in self._defaults:
                tensor.masked_fill_(aligned(self.bad, tensor), 0.0)

    def reset(self, worlds: Tensor) -> None:
        chosen = self._mask(worlds)
        for name, (tensor, default) in self._defaults.items():
            if name == "qpos" and "qpos0" in self._expanded:
                default = self._expanded["qpos0"][0]
            _put(tensor, chosen, default)
            if name in self._flags:
                self._bound[name].copy_(tensor)

    def forward(self, worlds: Tensor) -> None:
        # Kernels run on every world, so what the last substep left in the other worlds is put back.
        others = ~self._mask(worlds)
        kept = {name: tensor.clone() for name, tensor in self._bound.items() if name not in _STATE}
        self._push()
        self._launch(0)
        for name, before in kept.items():
            _put(self._bound[name], others, before)

    def check(self, task: str) -> None:
        check_room(self._data.overflow.numpy(), self.capacity, task)

    def snapshot(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        model, data = copy.copy(self.model), mujoco.MjData(self.model)
        for field, (values, _) in self._expanded.items():
            attrgetter(field)(model)[:] = values[world].cpu().numpy()
        if self._expanded:
            mujoco.mj_setConst(model, data)
        for name in _MEMORY:
            value = self._defaults[name][0][world].cpu().numpy()
            if name == "time":
                data.time = float(value)
            else:
                getattr(data, name)[:] = value
        mujoco.mj_forward(model, data)
        return model, data

    def writable(self) -> list[Tensor]:
        bound = [tensor for name, tensor in self._bound.items() if name in (*_STATE, *INPUT_FIELDS)]
        return bound + [values for values, _ in self._expanded.values()]

    def memory(self) -> dict[str, Tensor]:
        fields = {name: tensor for name, (tensor, _) in self._defaults.items()}
        fields |= {f"bound/{name}": tensor for name, tensor in self._bound.items()}
        return fields | {f"expanded/{name}": values for name, (values, _) in self._expanded.items()}

    def load_state_dict(self, saved: Mapping[str, Tensor]) -> None:
        super().load_state_dict(saved)
        with wp.ScopedDevice(self._device):
            self._refresh()  # a step begins with the fields that the step before derived at its end

    def _tensor(self, field: str) -> Tensor:
        """An MjData field (N, ...) of the simulator's own memory, in MuJoCo's own shape."""
        tensor = wp.to_torch(getattr(self._data, field))
        return tensor.view(self.num_worlds, *np.shape(getattr(self._plain, field)))

    def _default(self, field: str) -> Tensor:
        tensor = self._tensor(field)
        return torch.as_tensor(np.array(getattr(self._plain, field)), device=self.device).to(tensor.dtype)

    def _mask(self, worlds: Tensor) -> Tensor:
        if worlds.dtype == torch.bool:
            return worlds
        return torch.zeros_like(self.bad).index_fill(0, worlds, True)

    def _push(self) -> None:
        """Take over what the task wrote into the model, or into copies (`_flags`) of the simulator's memory."""
        for name, flags in self._flags.items():
            flags.copy_(self._bound[name] != 0)
        # torch counts writes on the host: looking at the counter does not wait for the device.
        changed = {name: values for name, (values, seen) in self._expanded.items() if values._version != seen}
        if changed:
            with wp.ScopedDevice(self._device):
                if any(map(derives, changed)):
                    mjw.set_const(self._model, self._data)
                self._refresh()
            self._expanded |= {name: (values, values._version) for name, values in changed.items()}

    def _launch(self, substeps: int) -> None:
        """Run the kernels, or replay them on a GPU. Warp's streams and torch's default stream wait for each other."""
        if not self._device.is_cuda:
            self._run(substeps)
            return
        if substeps not in self._graphs:
            with wp.ScopedCapture(self._device) as capture:
                self._run(substeps)
            assert capture.graph is not None
            self._graphs[substeps] = capture.graph
        wp.capture_launch(self._graphs[substeps])

    def _run(self, substeps: int) -> None:
        """Run the kernels of `step`, or those of `forward` where `substeps` is 0. Before and after a step, the fields
        derived from positions and velocities are current."""
        model, data = self._model, self._data
        with wp.ScopedDevice(self._device):
            if not substeps:
                self._refresh()
                mjw.fwd_actuation(model, data)
                mjw.fwd_acceleration(model, data)
                mjw.solve(model, data)
                mjw.sensor_acc(model, data)
            for _ in range(substeps):
                mjw.step2(model, data)
                wp.copy(self._kept, data.sensordata)
                self._refresh()
            if substeps and self._late.size:
                wp.launch(_keep, dim=data.sensordata.shape, inputs=[self._late, self._kept], outputs=[data.sensordata])

    def _refresh(self) -> None:
        """Recompute everything that follows from positions and velocities alone."""
        if self._moving_anchors:
            # step1 needs an anchor's acceleration before it computes the velocities for it (mujoco_warp 4.0). Without
            # this, the constraints on the feet of BallBalance would use velocities of the step before.
            mjw.fwd_kinematics(self._model, self._data)
            mjw.com_vel(self._model, self._data)
        mjw.step1(self._model, self._data)

    def _widen(self, field: str) -> None:
        """Give each world its own row of an array that all worlds share."""
        shared = attrgetter(field)(self._model)
        if shared.shape[0] == self.num_worlds:
            return
        with wp.ScopedDevice(self._device):
            wide = wp.zeros((self.num_worlds, *shared.shape[1:]), dtype=shared.dtype)
        if wide.size:
            wp.to_torch(wide).copy_(wp.to_torch(shared))
        owner, _, name = field.rpartition(".")
        setattr(getattr(self._model, owner) if owner else self._model, name, wide)

    def _note_bad(self) -> None:
        sound = torch.ones_like(self.bad)
        for name, limit in LIMITS.items():
            sound &= (self._defaults[name][0].abs() <= limit).all(dim=1)  # False for NaN
        torch.logical_not(sound, out=self.bad)


def check_room(overflow: np.ndarray, capacity: Capacity, task: str) -> None:
    """Raises CapacityError unless there was room, by `Data.overflow` (N,); see `Worlds.check`."""
    lacking = int(np.bitwise_or.reduce(overflow))
    for setting, flags in _OVERFLOWS.items():
        if lacking & flags:
            room = capacity.contacts if setting == "max_contacts" else capacity.constraints
            raise CapacityError(
                f"The GPU simulation of {task} has room for {room} {setting.removeprefix('max_')} per world, which "
                f"was not enough: raise `{setting}` in the task's class."
            )


@wp.kernel
def _keep(columns: wp.array[bool], kept: wp.array2d[float], sensordata: wp.array2d[float]):  # noqa: ANN202 - Warp reads the types
    """Sensors of forces and accelerations keep the values of the last substep."""
    world, column = wp.tid()  # pyright: ignore
    if columns[column]:
        sensordata[world, column] = kept[world, column]  # pyright: ignore


def _put(tensor: Tensor, chosen: Tensor, values: Tensor) -> None:
    """Write the rows (N, ...) that `chosen` (N,) picks, without asking the device how many there are."""
    tensor.copy_(torch.where(aligned(chosen, tensor), values, tensor))
