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
"""[m/s] or [rad/s] of any degree of freedom. Nothing that works is so fast: the integration has failed, and the numbers
of such a world would outweigh those of all others."""


def derives(field: str) -> bool:
    """Whether `mj_setConst` derives others from a field of MjModel, or from `opt.<field>`."""
    return field in mujoco.MjModel._setconst_inputs or field.startswith("opt.")


class Worlds(ABC):
    """N worlds that step side by side, whatever steps them.

    Attributes:
        num_worlds: N.
        bad: (N,) bool, worlds that broke down in the last `step`; the caller resets them.
        playing: (N,) bool, worlds whose steps count for something; None for all. The others may stand still.
        after_replayed_step: called after each step that `load_state_dict` plays again, which may take minutes.

    Worlds are named by their indices (k,) int64, or by a mask (N,) bool, which no device needs to be asked the size of.
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
        """Put worlds into their default state with zero inputs. What is derived from it follows at `forward`."""

    @abstractmethod
    def forward(self, worlds: Tensor) -> None:
        """Take over written state of worlds and recompute what is derived from it."""

    @abstractmethod
    def memory(self) -> dict[str, Tensor]:
        """All that the next `step` depends on, as live tensors (N, ...) by name."""

    def state_dict(self) -> dict[str, Tensor]:
        """A copy of `memory`."""
        return {name: value.clone() for name, value in self.memory().items()}

    def load_state_dict(self, saved: Mapping[str, Tensor]) -> None:
        """Go on where others of the same kind were."""
        for name, value in self.memory().items():
            value.copy_(saved[name])

    @abstractmethod
    def check(self, task: str) -> None:
        """Ask, between rollouts, whether all contacts and constraints found room.

        Raises:
            TaskError: when some did not; says which setting of the task to raise.
        """


class Simulator(Worlds):
    """N copies of one MuJoCo model.

    Field names are MjData's and MjModel's, in MuJoCo's own conventions (quaternions w, x, y, z; free-joint angular
    velocity in the body frame). Tensors are float32 on `device`.

    Attributes:
        model: the compiled model; per-world values live in `expand`.
        bad: (N,) bool, worlds whose physics broke down in the last `step` (not finite, faster than `MAX_SPEED`, or a
            MuJoCo warning): whoever steps them resets them.
    """

    model: mujoco.MjModel

    @abstractmethod
    def bind(self, field: str) -> Tensor:
        """A live (N, ...) tensor of an MjData field.

        Inputs (`ctrl`, `xfrc_applied`, ...) are read at the next `step`; state (`qpos`, `qvel`) is read at the next
        `forward`, for the worlds named there; in others it must not be written. Every bound field is current after
        `step` and `forward`, except that forces and acceleration sensors after `step` are those of its last substep.
        After `reset` the state is, and the rest once `forward` is called.
        """

    @abstractmethod
    def expand(self, field: str) -> Tensor:
        """Per-world values (N, ...) of an MjModel field, or of `opt.<field>`, used from the next call on."""

    @abstractmethod
    def snapshot(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """One world as plain MuJoCo objects, for rendering."""

    @abstractmethod
    def writable(self) -> list[Tensor]:
        """The bound fields that may be written and the expanded ones, live."""


_CONTACTS_PER_GEOM = 4
_SPARE_CONTACTS = 16


class Capacity(NamedTuple):
    """Room of one world. Zeros stand for a guess."""

    contacts: int = 0
    """On average: worlds share this room."""
    constraints: int = 0
    """Rows; every world has its own."""


GUESS = Capacity()


def capacity(model: mujoco.MjModel, wanted: Capacity) -> Capacity:
    """`wanted`, its zeros filled in generously from the model.

    There is room for four contacts for each geom of a moving body that may touch something: a box lies on four points.
    A contact with friction is up to 2 * (condim - 1) rows, a limit or dry friction of a joint one, an equality six. The
    larger condim of two geoms counts, which may be the floor's, or that of a pair.
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
