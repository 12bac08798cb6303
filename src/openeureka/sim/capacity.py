"""Room for contacts and constraints: on a GPU memory is set aside before the first step."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

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
    A contact with friction is up to 2 * (condim - 1) rows, a limit or dry friction of a joint one, an equality six.
    """
    touching = (model.body_weldid[model.geom_bodyid] != 0) & ((model.geom_contype | model.geom_conaffinity) != 0)
    contacts = wanted.contacts or _SPARE_CONTACTS + _CONTACTS_PER_GEOM * int(touching.sum())
    rows = max(1, 2 * (int(model.geom_condim[touching].max(initial=1)) - 1))
    frictions = np.count_nonzero(model.dof_frictionloss) + np.count_nonzero(model.tendon_frictionloss)
    limits = np.count_nonzero(model.jnt_limited) + np.count_nonzero(model.tendon_limited)
    constraints = wanted.constraints or 6 * model.neq + int(frictions + limits) + rows * contacts
    return Capacity(contacts, constraints)
