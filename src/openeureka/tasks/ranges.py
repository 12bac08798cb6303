"""What `randomise=` names, checked before anything is trained."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import mujoco
import yaml
from yaml.composer import ComposerError

from ..config import NO_RANGES
from ..errors import ConfigError, nearest
from ..sim.perturb import FACTORS, acts, peak
from ..types import NOMINAL, Ranges
from ..types.dynamics import QUANTITIES, SCALES, Dynamics
from .anatomy import driven_joints, floating_joint
from .registry import get
from .task import Task

Pairs = Mapping[str, tuple[float, float]]

NAMED: Mapping[str, Pairs] = {
    "mild": {
        "mass": (0.9, 1.1),
        "friction": (0.8, 1.2),
        "strength": (0.9, 1.1),
        "delay": (0.0, 0.02),
        "noise": (0.0, 0.02),
    },
    "wide": {
        "mass": (0.7, 1.3),
        "friction": (0.7, 1.3),
        "strength": (0.7, 1.3),
        "delay": (0.0, 0.04),
        "noise": (0.0, 0.05),
        "push": (0.0, 0.5),
    },
}
"""Ranges by name. A task takes the quantities that change anything of it."""


class _Table(yaml.SafeLoader):
    """Reads words, numbers, and lists of them by name. YAML's other types raise all sorts of errors on damaged text,
    and its references can expand to terabytes."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent) or getattr(event, "tag", None) is not None:
            raise ComposerError(None, None, "a table has no references and no tags", event.start_mark)
        return super().compose_node(parent, index)


_Table.yaml_implicit_resolvers = {}
_Table.add_implicit_resolver("tag:yaml.org,2002:int", re.compile(r"[-+]?(0|[1-9][0-9]{0,8})\Z"), list("-+0123456789"))
_Table.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)(e[-+]?[0-9]+)?\Z", re.I),
    list("-+.0123456789"),
)


def find(env: str, randomise: str) -> Ranges | None:
    """The ranges of a name or of a YAML file; None for `none`.

    Raises:
        ConfigError: when there are no such ranges, or one makes no sense or would change nothing of the task.
    """
    if randomise == NO_RANGES:
        return None
    task = get(env)
    if task.steps_itself:
        raise ConfigError(f"`{task.env}` steps itself, so openeureka cannot randomise it; use randomise=none.")
    model = task.compile_model()
    if randomise in NAMED:
        return _taken(task, model, NAMED[randomise])
    if not randomise.endswith((".yaml", ".yml")):
        raise ConfigError(
            f"There are no ranges `{randomise}`.{nearest(randomise, NAMED)} `randomise` takes none, {', '.join(NAMED)} "
            "or a YAML file."
        )
    path = Path(randomise)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"Cannot read the ranges {path}: {error.strerror}; check its path and permissions.") from None
    except UnicodeDecodeError:
        raise ConfigError(f"The ranges {path} are not YAML: the file is not text in UTF-8.") from None
    return written(task, model, text, str(path))


def written(task: type[Task], model: mujoco.MjModel, text: str, where: str) -> Ranges:
    """The ranges in a YAML text, one quantity per line.

    Args:
        where: what messages call the text.

    Raises:
        ConfigError: for any other text, for what the task does not have, and where nothing would change.
    """
    try:
        found = yaml.load(text, Loader=_Table)
    except (yaml.YAMLError, RecursionError, ValueError, OverflowError) as error:
        raise ConfigError(f"The ranges {where} are not YAML: {' '.join(str(error).split())[:200]}.") from None
    if not (isinstance(found, dict) and found):
        raise ConfigError(f"{where} holds no ranges, such as `mass: [0.8, 1.2]`.")
    pairs = {str(name): checked(str(name), value, where) for name, value in cast(dict[Any, Any], found).items()}
    for name, (_, most) in pairs.items():
        if why := useless(task, model, name, most):
            raise ConfigError(f"`{name}` in {where} changes nothing of `{task.env}`, {why}; leave it out.")
    if "push_every" in pairs and pairs.get("push", (0.0, 0.0))[1] == 0.0:
        raise ConfigError(f"`push_every` in {where} changes nothing without a `push`; add one, or leave it out.")
    found = ranges(pairs)
    if not found.drawn:
        raise ConfigError(
            f"{where} leaves `{task.env}` as it is; write ranges that differ, such as `mass: [0.8, 1.2]`."
        )
    return found


def uniform(task: type[Task], model: mujoco.MjModel) -> Ranges:
    """The ranges `wide`, as far as they change anything of the task."""
    return _taken(task, model, NAMED["wide"])


def _taken(task: type[Task], model: mujoco.MjModel, pairs: Pairs) -> Ranges:
    return ranges({name: pair for name, pair in pairs.items() if not useless(task, model, name, pair[1])})


def described(task: type[Task], model: mujoco.MjModel) -> str:
    """A robot as text: its bodies' masses, its joints and drives, and how often it acts."""
    masses = ", ".join(f"{model.body(b).name} {model.body_mass[b]:.3g}" for b in range(1, model.nbody))
    joints = ", ".join(model.joint(joint).name for joint in driven_joints(model))
    damping, armature = model.dof_damping, model.dof_armature
    drives = [f"  {model.actuator(a).name}: {_drive(model, a)}" for a in range(model.nu)]
    return "\n".join(
        (
            f"Mass {model.body_mass.sum():.4g} kg in all: {masses}.",
            f"Driven joints: {joints}. Damping {damping.min():.3g} to {damping.max():.3g} N m s/rad, armature "
            f"{armature.min():.3g} to {armature.max():.3g} kg m2.",
            f"It acts every {task.control_dt:.3g} s. Drives, whose force is gain * control + bias, as MuJoCo has it:",
            *drives,
        )
    )


def _drive(model: mujoco.MjModel, actuator: int) -> str:
    gear = f"gear {model.actuator_gear[actuator, 0]:.3g}"
    gain, bias = model.actuator_gainprm[actuator], ", ".join(f"{x:.3g}" for x in model.actuator_biasprm[actuator, :3])
    if model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_MUSCLE):
        number = peak(model, actuator)
        return f"muscle, {'peak force' if number == 2 else 'scale of its peak force'} {gain[number]:.3g}, {gear}"
    if model.actuator_gaintype[actuator] == int(mujoco.mjtGain.mjGAIN_FIXED):
        return f"gain {gain[0]:.3g}, {gear}, bias {bias}"
    return gear


def ranges(pairs: Pairs) -> Ranges:
    """The ranges of these quantities; the others are as the task has them."""
    low, high = (Dynamics(**{name: pair[end] for name, pair in pairs.items()}) for end in (0, 1))
    return Ranges(low, high)


def checked(name: str, value: object, where: str) -> tuple[float, float]:
    """Low and high of a quantity.

    Raises:
        ConfigError: for an unknown quantity, or a value that is no range of it.
    """
    if name not in QUANTITIES:
        raise ConfigError(
            f"{where} has an unknown `{name}`.{nearest(name, QUANTITIES)} It may have {', '.join(SCALES)}."
        )
    pair: list[Any] = cast(list[Any], value) if isinstance(value, list) else [value, value]
    scale = SCALES[name]
    if (
        len(pair) != 2
        or not all(type(end) in (int, float) for end in pair)
        or not scale.least <= pair[0] <= pair[1] <= scale.most
    ):
        raise ConfigError(
            f"`{name}: {value!s:.60}` in {where} is no range; write the lowest and the highest {scale.unit}, from "
            f"{scale.least:g} to {scale.most:g}, such as `{name}: {_example(name)}`."
        )
    return float(pair[0]), float(pair[1])


def _example(name: str) -> list[float]:
    own = float(getattr(NOMINAL, name))
    return [round(0.8 * own, 3), round(1.2 * own, 3)] if own else [0.0, {"delay": 0.04, "push": 0.5}.get(name, 0.05)]


def useless(task: type[Task], model: mujoco.MjModel, name: str, most: float = math.inf) -> str:
    """Why a quantity of at most `most` changes nothing of a task; empty where it changes something."""
    if name in FACTORS and not acts(model, name):
        return "whose model has nothing of the kind"
    if name in ("push", "push_every") and floating_joint(model) < 0:
        return "which has no floating base"
    if name == "delay" and task.choices:
        return "whose actions are choices"
    if name == "delay" and most < task.control_dt / 2:
        return f"whose steps of {task.control_dt:g} s are too long for it"
    return ""
