"""Turns program text into a function of the state. It runs generated Python: for the confined child only."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import torch
from torch import Tensor

from . import math as helper_functions
from . import surface
from .gate import FILENAME, Program

Runner = Callable[[Mapping[str, Any]], object]
"""Takes every state variable, `num_envs` and `device` by name; returns whatever the program returns."""


def _cosine_similarity(x1: Tensor, x2: Tensor, dim: int = 1, eps: float = 1e-8) -> Tensor:
    lengths = x1.norm(dim=dim).clamp(min=eps) * x2.norm(dim=dim).clamp(min=eps)
    return (x1 * x2).sum(dim=dim) / lengths


def _isclose(input: Tensor, other: Tensor, rtol: float = 1e-5, atol: float = 1e-8) -> Tensor:
    return (input - other).abs() <= atol + rtol * other.abs()


# torch's own write in place below the level that tracing sees.
_REPLACED = {"cosine_similarity": _cosine_similarity, "isclose": _isclose}
_TAKES_FLOATS = surface.words("abs cos exp log max maximum min minimum sigmoid sin sqrt square tanh")
"""Functions of tensors that authors also call with Python floats, as in `torch.max(x, 0.0)`."""


def _namespace(module: str, real: Any) -> SimpleNamespace:
    return SimpleNamespace(**{name: _offered(name, real) for name in surface.MODULES[module]})


def _offered(name: str, real: Any) -> Any:
    if name in _REPLACED:
        return _REPLACED[name]
    function = getattr(real, name)
    if name not in _TAKES_FLOATS:
        return function
    return lambda *args, **kwargs: function(*map(_as_tensor, args), **kwargs)


def _as_tensor(value: Any) -> Any:
    return torch.tensor(value) if type(value) is float else value


def _modules() -> SimpleNamespace:
    """Stand-ins that hold the allowed names and nothing else, so that a slip of the gate finds no `torch.os`."""
    offered = _namespace("torch", torch)
    offered.nn = SimpleNamespace(functional=_namespace("torch.nn.functional", torch.nn.functional))
    offered.linalg = _namespace("torch.linalg", torch.linalg)
    offered.device = lambda *_: torch.device("cpu")
    return SimpleNamespace(torch=offered, math=SimpleNamespace(**{name: getattr(math, name) for name in surface.MATH}))


def load(program: Program) -> Runner:
    """The program as a function of a mapping that holds its inputs."""
    modules = _modules()
    # torch imports lazily from C through the builtins of the running frame, hence `__import__`; no program may name it.
    allowed = {name: getattr(builtins, name) for name in (*surface.BUILTINS, "__import__")}
    names: dict[str, Any] = {"__builtins__": allowed}
    names.update({name: getattr(helper_functions, name) for name in surface.HELPERS})
    for name, path in program.draft.names.items():
        value: Any = modules
        for part in path.split("."):
            value = getattr(value, part, None)
        names[name] = value
    exec(program.code(), names)  # the gate's plain form: functions and literal constants
    function = names[program.entry]
    free = [name for name in program.inputs if name not in program.arguments]

    def run(state: Mapping[str, Any]) -> object:
        if program.method:
            return function(SimpleNamespace(**{name: state[name] for name in program.inputs}))
        names.update({name: state[name] for name in free})
        return function(**{name: state[name] for name in program.arguments})

    return run


def unchecked(source: str) -> Runner:
    """A program as it stands, with all of Python: what tests of confinement run, behind a gate that is switched off."""
    names: dict[str, Any] = {"torch": torch, "math": math}
    names.update({name: getattr(helper_functions, name) for name in surface.HELPERS})

    def run(state: Mapping[str, Any]) -> object:
        if "__builtins__" not in names:
            exec(compile(source, FILENAME, "exec"), names)
        functions = [value for value in names.values() if getattr(value, "__code__", None) and value.__module__ is None]
        wanted = functions[-1].__code__
        return functions[-1](*(state[name] for name in wanted.co_varnames[: wanted.co_argcount]))

    return run
