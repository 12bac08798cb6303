"""What is wrong with a person's own task, as one sentence that names file, line and error."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from ..errors import TaskError, told
from ..plugins import where_to_put
from ..sim import Simulator
from ..types import StateSpec
from .task import Recipe, Score, Task

_OURS = __name__.partition(".")[0]


def fault(error: BaseException) -> TaskError | None:
    """What a person's task did wrong, at the innermost call of its code in the error's traceback.

    None where there is no such call. Code of this package's tasks does not count: its errors are programming errors.
    """
    sentence = _placed(error, _is_of_a_person)
    return TaskError(sentence) if sentence else None


def told_where(error: BaseException) -> str:
    """As `told`, with file and line where the error came from code outside of this package."""
    return _placed(error, lambda module: not _is_ours(module)) or told(error)


def _placed(error: BaseException, counts: Callable[[Mapping[str, Any]], bool]) -> str:
    """The error and the innermost call in a module that counts; empty where there is no such call."""
    calls = [(frame, line) for frame, line in traceback.walk_tb(error.__traceback__) if counts(frame.f_globals)]
    if not calls:
        return ""
    frame, line = calls[-1]
    return f"{frame.f_code.co_filename}, line {line}, in `{frame.f_code.co_name}`: {told(error)}"


def _is_of_a_person(module: Mapping[str, Any]) -> bool:
    if _is_ours(module):
        return False
    return any(isinstance(value, type) and issubclass(value, Task) for value in list(module.values()))


def _is_ours(module: Mapping[str, Any]) -> bool:
    return str(module.get("__name__")).partition(".")[0] == _OURS


def import_fault(place: str, error: BaseException) -> TaskError:
    """What went wrong while the module of a dotted name, or the file, was imported."""
    if isinstance(error, SyntaxError):
        shown = f" `{error.text.strip()}`" if error.text else ""
        return TaskError(f"The environment in {place} cannot be imported: {told(error)[:-1]}{shown}.")
    lines = [line for frame, line in traceback.walk_tb(error.__traceback__) if _stands_at(frame.f_globals, place)]
    where = f"line {lines[-1]}: " if lines else ""
    return TaskError(f"The environment in {place} cannot be imported: {where}{told(error)}{where_to_put(place, error)}")


def _stands_at(module: Mapping[str, Any], place: str) -> bool:
    file = str(module.get("__file__"))
    return module.get("__name__") == place or (place.endswith(".py") and file.endswith(place.lstrip("./")))


def _is_count(value: Any) -> bool:
    return isinstance(value, Integral) and int(value) > 0


def _takes(function: Callable[..., Any], count: int) -> bool:
    try:
        inspect.signature(function).bind(*[None] * count)
    except TypeError:
        return False
    return True


_WANTED: Mapping[str, tuple[Callable[[Any], bool], str]] = {
    "description": (lambda value: isinstance(value, str), "a sentence"),
    **dict.fromkeys(("episode_length", "substeps", "num_actions"), (_is_count, "a whole number above zero")),
    "control_dt": (lambda value: isinstance(value, Real) and float(value) > 0.0, "a number of seconds above zero"),
    "num_observations": (lambda value: isinstance(value, Integral), "a whole number"),
    "spec": (lambda value: isinstance(value, StateSpec), "a StateSpec"),
    "recipe": (lambda value: isinstance(value, Recipe), "a Recipe"),
    "human": (lambda value: isinstance(value, str | Path), "the text of a reward program, or the Path of its file"),
    "memory": (lambda value: isinstance(value, tuple | list), "a tuple of names"),
    "score_range": (
        lambda value: isinstance(value, tuple) and [isinstance(v, Real | None) for v in value] == [True, True],
        "the least and the largest F, such as (0.0, None)",
    ),
    "model": (lambda value: _takes(value, 0), "a function without arguments: write @staticmethod above it"),
}
"""Attributes of a task's class: a check of the value, and what is wanted."""


def check_class(task: type[Task]) -> None:
    """Raises TaskError where an attribute of a task's class has a value that cannot be used."""
    for name, (fits, wanted) in _WANTED.items():
        value = getattr(task, name)
        if not fits(value):
            given = "" if callable(value) else f"; it is {value!r:.60}"
            raise TaskError(f"`{name}` of the task `{task.env}` must be {wanted}{given}.")
    if not _takes(task, 2):
        raise TaskError(
            f"`__init__` of the task `{task.env}` must take two arguments: write def __init__(self, *args)."
        )


def check_variables(task: Task, state: Mapping[str, Any]) -> None:
    """Raises TaskError unless the state holds every variable of `spec`, except for the observation, in its shape."""
    for variable in task.spec.variables:
        if variable.name == "obs_buf":
            continue
        if variable.name not in state:
            raise _broken(task, "compute_state", f"returns no `{variable.name}`, which `spec` lists")
        if variable.kind in ("world", "constant"):
            shape = (task.num_envs, *variable.shape) if variable.kind == "world" else variable.shape
            _expect(task, "compute_state", f"`{variable.name}`", state[variable.name], shape, "as `spec` says")
            if state[variable.name].dtype in (torch.bool, torch.float64):  # whole numbers may be indices
                _expect_float(task, "compute_state", f"`{variable.name}`", state[variable.name])


def check_views(task: Task, state: Mapping[str, Any]) -> None:
    """Raises TaskError where a state variable is the memory of the simulator or of the task: recorded states would
    change, and the last step of an episode would be paid for the state after the reset."""
    remembered = {name: getattr(task, name) for name in (*task.memory, "progress")}
    owners = {value.untyped_storage().data_ptr(): f"`self.{name}`" for name, value in remembered.items()}
    owners |= {value.untyped_storage().data_ptr(): "what `bind` returns" for value in task.sim.memory().values()}
    tensors = {name: value for name, value in state.items() if isinstance(value, Tensor) and value.numel()}
    owned = {name: owners.get(value.untyped_storage().data_ptr()) for name, value in tensors.items()}
    if views := {f"`{name}`": owner for name, owner in owned.items() if owner is not None}:
        called, whose = (", ".join(dict.fromkeys(words)) for words in (views, views.values()))
        raise TaskError(
            f"{called} of the task `{task.env}` would change after being recorded, as the tensor belongs to the"
            f" simulator or to the task; in `compute_state`, add .clone() to {whose}."
        )


def marks(task: Task) -> dict[str, tuple[Tensor, int]]:
    """Every tensor that a task holds, with a number that grows when it is written to."""
    return {name: (value, value._version) for name, value in task.tensors().items()}


def check_memory(task: Task, before: Mapping[str, tuple[Tensor, int]]) -> None:
    """Raises TaskError when a reset wrote what `memory` does not list: a GPU would change it in all worlds."""
    known, after = task.lasting(), marks(task)
    for name in task.memory:
        if name not in after or after[name][0].shape[:1] != (task.num_envs,):
            raise TaskError(
                f"`memory` of the task `{task.env}` lists `{name}`, but `self.{name}` is not a tensor (N, ...)."
            )
    for name, (value, version) in after.items():
        old, old_version = before.get(name, (None, 0))
        if name not in known and (value is not old or version != old_version):
            raise _broken(task, "reset", f"writes `{name}`, which `memory` does not list; add it: (..., {name!r})")


def inputs(task: Task) -> dict[str, Tensor]:
    """Attributes that are whole writable fields of the simulator, such as `ctrl`."""
    fields = task.sim.writable() if isinstance(task.sim, Simulator) else []
    places = {(field.data_ptr(), field.shape) for field in fields}
    own = {name: value for name, value in vars(task).items() if isinstance(value, Tensor)}
    return {name: value for name, value in own.items() if (value.data_ptr(), value.shape) in places}


def check_inputs(task: Task, before: Mapping[str, Tensor]) -> None:
    """Raises TaskError when one of `inputs` was replaced: the simulator would go on reading the old tensor."""
    for name in before.keys() - inputs(task).keys():
        raise TaskError(
            f"The task `{task.env}` replaces `self.{name}`, which belongs to the simulator, so the simulator never sees"
            f" the new values: write self.{name}[:] = ..., or start from a .clone() if it is meant for the task alone."
        )


def check_finite(task: Task, state: Mapping[str, Any], counts: Tensor) -> None:
    """Raises TaskError where a world (N,) that counts has a state variable or an observation that is not finite."""
    for name in (*(name for name in task.spec.names if name != "obs_buf"), "obs_buf"):  # first what it may be made of
        value = state[name]
        if not isinstance(value, Tensor):
            continue
        if not (value[counts] if value.shape[:1] == counts.shape else value).isfinite().all():
            raise TaskError(
                f"`{name}` of the task `{task.env}` is not finite in some states of random play; keep it finite, for"
                " example with x / max(y, 0.01) in place of x / y."
            )


def check_observation(task: Task, state: Mapping[str, Any]) -> None:
    """Raises TaskError unless the observation has the size that the class says."""
    seen, wanted = state["obs_buf"], (task.num_envs, task.num_observations)
    _expect(task, "observe", "observations", seen, wanted, f"as num_observations={wanted[1]} says")
    _expect_float(task, "observe", "observations", seen)
    if "obs_buf" in task.spec and task.spec["obs_buf"].shape != wanted[1:]:
        shape = task.spec["obs_buf"].shape
        raise TaskError(
            f"`spec` of the task `{task.env}` lists `obs_buf` with the shape {shape}, but num_observations={wanted[1]}"
            f" means {wanted[1:]}; make them agree."
        )


def per_world(task: Task, method: str, value: Any) -> Tensor:
    """The value, one number per world. Raises TaskError where it is anything else."""
    _expect(task, method, "a value", value, (task.num_envs,), "one per world")
    return value


def decided(task: Task, method: str, value: Any) -> Tensor:
    """The value, true or false per world. Raises TaskError where it is anything else."""
    if per_world(task, method, value).dtype != torch.bool:
        raise _broken(task, method, f"returns {value.dtype}; it must return torch.bool, as a comparison does")
    return value


def scored(task: Task, score: Any) -> Score:
    """The score, of one value and one weight per world. Raises TaskError where it is anything else."""
    if not isinstance(score, Score):
        wanted = "it must return a Score, as mean_over_steps and mean_over_episodes do"
        raise _broken(task, "fitness", f"returns {type(score).__name__}; {wanted}")
    return Score(*(per_world(task, "fitness", part) for part in score))


def _expect(task: Task, method: str, what: str, value: Any, shape: tuple[int, ...], why: str) -> None:
    if not isinstance(value, Tensor):
        raise _broken(task, method, f"returns {what} as {type(value).__name__}; a tensor of shape {shape} is needed")
    if tuple(value.shape) != shape:
        raise _broken(task, method, f"returns {what} of shape {tuple(value.shape)}; {shape} is needed, {why}")


def _expect_float(task: Task, method: str, what: str, value: Tensor) -> None:
    if value.dtype != torch.float32:
        raise _broken(task, method, f"returns {what} as {value.dtype}; torch.float32 is needed: add .float()")


def _broken(task: Task, method: str, what: str) -> TaskError:
    code = getattr(type(task), method).__code__
    return TaskError(f"{code.co_filename}, line {code.co_firstlineno}: `{method}` {what}.")
