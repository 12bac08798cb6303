"""Batched MuJoCo behind one small protocol, with room for contacts: a task never knows which simulator it runs on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import NamedTuple

import mujoco
import numpy as np
import torch
from torch import Tensor

INPUT_FIELDS = ("ctrl", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat", "eq_active")
STATE_FIELDS = ("qpos", "qvel", "act")
MAX_SPEED = 1000.0
"""[m/s] or [rad/s] of any degree of freedom. In a world that is faster the integration has failed, and its numbers
would outweigh those of all others."""


def derives(field: str) -> bool:
    """Whether `mj_setConst` derives other fields from a field of MjModel, or from `opt.<field>`."""
    return field in mujoco.MjModel._setconst_inputs or field.startswith("opt.")


def aligned(worlds: Tensor, values: Tensor) -> Tensor:
    """A mask or a factor for each world (N,), in the shape that broadcasts over `values` (N, ...)."""
    return worlds.view(-1, *[1] * (values.dim() - 1))


class Worlds(ABC):
    """N worlds that step side by side, in any kind of simulator.

    Attributes:
        num_worlds: N.
        bad: (N,) bool, worlds that broke down in the last `step`; the caller resets them.
        playing: (N,) bool, worlds whose steps count; None for all. The others need not be stepped.
        after_replayed_step: called after each step that `load_state_dict` replays, as that may take minutes.

    Methods take worlds as indices (k,) int64, or as a mask (N,) bool, which never makes the host wait for the device.
    """

    num_worlds: int
    device: torch.device
    bad: Tensor
    playing: Tensor | None = None
    after_replayed_step: Callable[[], object] | None = None

    @abstractmethod
    def step(self, substeps: int) -> None:
        """Advance all worlds by `substeps` timesteps under constant inputs."""

    @abstractmethod
    def reset(self, worlds: Tensor) -> None:
        """Put worlds into their default state with zero inputs. Derived fields are updated by `forward`."""

    @abstractmethod
    def forward(self, worlds: Tensor) -> None:
        """Take over the written state of worlds, and recompute the fields derived from it."""

    @abstractmethod
    def memory(self) -> dict[str, Tensor]:
        """All that the next `step` depends on, as live tensors (N, ...) by name."""

    def state_dict(self) -> dict[str, Tensor]:
        """A copy of `memory`."""
        return {name: value.clone() for name, value in self.memory().items()}

    def load_state_dict(self, saved: Mapping[str, Tensor]) -> None:
        """Continue from the `state_dict` of other worlds of the same kind."""
        for name, value in self.memory().items():
            value.copy_(saved[name])

    @abstractmethod
    def check(self, task: str) -> None:
        """Check, between rollouts, that there was room for all contacts and constraints.

        Raises:
            TaskError: when there was not; it says which setting of the task to raise.
        """


class Simulator(Worlds):
    """N copies of one MuJoCo model.

    Field names are MjData's and MjModel's, in MuJoCo's own conventions (quaternions w, x, y, z; free-joint angular
    velocity in the body frame). Tensors are float32 on `device`.

    Attributes:
        model: the compiled model; per-world values live in `expand`.
        bad: (N,) bool, worlds whose physics broke down in the last `step` (not finite, faster than `MAX_SPEED`, or a
            MuJoCo warning); the caller resets them.
    """

    model: mujoco.MjModel

    @abstractmethod
    def bind(self, field: str) -> Tensor:
        """A live (N, ...) tensor of an MjData field.

        Inputs (`ctrl`, `xfrc_applied`, ...) are read at the next `step`; state (`qpos`, `qvel`) is read at the next
        `forward`, for the worlds passed to it; in others it must not be written. Every bound field is current after
        `step` and `forward`, except that forces and acceleration sensors after `step` are those of its last substep.
        After `reset` only the state is current, and the rest after the next `forward`.
        """

    @abstractmethod
    def expand(self, field: str) -> Tensor:
        """Per-world values (N, ...) of an MjModel field, or of `opt.<field>`, used from the next call on."""

    @abstractmethod
    def snapshot(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """One world as plain MuJoCo objects, for rendering."""

    @abstractmethod
    def writable(self) -> list[Tensor]:
        """Live tensors of the bound fields that may be written, and of the expanded fields."""


_CONTACTS_PER_GEOM = 4
_SPARE_CONTACTS = 16


class Capacity(NamedTuple):
    """Room for the contacts and constraints of one world; 0 means a guess."""

    contacts: int = 0
    """On average: worlds share this room."""
    constraints: int = 0
    """Rows; every world has its own."""


GUESS = Capacity()


def capacity(model: mujoco.MjModel, wanted: Capacity) -> Capacity:
    """`wanted`, with generous guesses from the model in place of zeros.

    A guess has four contacts for each geom of a moving body that may collide: a box lies on four points. A contact with
    friction takes up to 2 * (condim - 1) rows, a limit or dry friction of a joint one, an equality six. The condim is
    the largest of any geom or pair: of two geoms the larger one counts, which may be the floor's.
    """
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    touching = solid & (model.body_weldid[model.geom_bodyid] != 0)
    contacts = wanted.contacts or _SPARE_CONTACTS + _CONTACTS_PER_GEOM * int(touching.sum())
    condim = np.concatenate((model.geom_condim[solid & touching.any()], model.pair_dim)).max(initial=1)
    rows = max(1, 2 * (int(condim) - 1))
    frictions = np.count_nonzero(model.dof_frictionloss) + np.count_nonzero(model.tendon_frictionloss)
    limits = np.count_nonzero(model.jnt_limited) + np.count_nonzero(model.tendon_limited)
    constraints = wanted.constraints or 6 * model.neq + int(frictions + limits) + rows * contacts
    return Capacity(contacts, constraints)
