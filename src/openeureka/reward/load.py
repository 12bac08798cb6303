"""Turns program text into a function of the state. What a model wrote runs in the confined child only."""

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
from .folding import numpy_name
from .gate import Program
from .math import holds_tensor, norm, tensor_of

Runner = Callable[[Mapping[str, Any]], object]
"""Takes every state variable, `num_envs` and `device` by name; returns whatever the program returns."""


def _cosine_similarity(x1: Tensor, x2: Tensor, dim: int = 1, eps: float = 1e-8) -> Tensor:
    if x1.shape != x2.shape:  # as in torch's own, `dim` counts in the common shape
        common = x1 + x2
        x1, x2 = x1.expand_as(common), x2.expand_as(common)
    # Divided first, as in torch's own: the product of large vectors may be infinite.
    a, b = (x / norm(x, dim=dim).clamp(min=eps).unsqueeze(dim) for x in (x1, x2))
    return (a * b).sum(dim=dim)


def _cdist(x1: Tensor, x2: Tensor, p: float = 2.0) -> Tensor:
    return norm(x1.unsqueeze(-2) - x2.unsqueeze(-3), p=p)


def _isclose(input: Tensor, other: Tensor, rtol: float = 1e-5, atol: float = 1e-8, equal_nan: bool = False) -> Tensor:
    error = (input - other).abs()
    close = (input == other) | ((error <= atol + rtol * other.abs()) & error.isfinite())
    return close | (input.isnan() & other.isnan()) if equal_nan else close


def _clamp(input: Any, min: Any = None, max: Any = None) -> Tensor:
    if isinstance(min, Tensor) or isinstance(max, Tensor):  # torch takes two tensors or two numbers
        min, max = (bound if bound is None else torch.as_tensor(bound) for bound in (min, max))
    return torch.clamp(_as_tensor(input), min, max)


def _count_nonzero(input: Tensor, dim: int | tuple[int, ...] | None = None) -> Tensor:
    return (input != 0).sum(dim=dim)


def _tensor(data: Any, **options: Any) -> Tensor:
    """`torch.tensor` that stacks lists of tensors. torch's own reads out their numbers, which tracing cannot see."""
    if isinstance(data, Tensor):
        return torch.as_tensor(data, **options).clone()
    return tensor_of(data, **options) if holds_tensor(data) else torch.tensor(data, **options)


# torch's own write in place below the level that tracing sees, read numbers out, or return uninitialised memory.
_REPLACED = {
    "cdist": _cdist,
    "clamp": _clamp,
    "clip": _clamp,
    "cosine_similarity": _cosine_similarity,
    "isclose": _isclose,
    "count_nonzero": _count_nonzero,
    "tensor": _tensor,
    "as_tensor": tensor_of,
    "empty": torch.zeros,
    "empty_like": torch.zeros_like,
}
_TAKES_FLOATS = surface.words("atan2 max maximum min minimum")
"""Functions of tensors that authors also call with Python floats, as in `torch.max(x, 0.0)`."""
_FIRST_FLOAT = surface.words("""
    abs acos asin atan ceil cos cosh exp expm1 floor log log10 log1p log2 pow relu round rsqrt sigmoid sign
    sin sinh sqrt square tan tanh
""")
"""The same for the first argument only, as in `torch.exp(-dt)`."""


def _namespace(module: str, real: Any) -> SimpleNamespace:
    return SimpleNamespace(**{name: _offered(name, real) for name in surface.MODULES[module]})


def _offered(name: str, real: Any) -> Any:
    if name in _REPLACED:
        return _REPLACED[name]
    function = getattr(real, name)
    if name not in _TAKES_FLOATS and name not in _FIRST_FLOAT:
        return function
    floats = None if name in _TAKES_FLOATS else 1

    def of_floats(*args: Any, **kwargs: Any) -> Any:
        return function(*map(_as_tensor, args[:floats]), *(args[floats:] if floats else ()), **kwargs)

    return of_floats


def _as_tensor(value: Any) -> Any:
    return torch.tensor(value) if type(value) is float else value


def _cpu(*_: object) -> torch.device:
    return torch.device("cpu")


def _modules() -> SimpleNamespace:
    """Stand-ins that hold the allowed names and nothing else: what slips through the gate finds no `torch.os`."""
    offered = _namespace("torch", torch)
    offered.nn = SimpleNamespace(functional=_namespace("torch.nn.functional", torch.nn.functional))
    offered.linalg = _namespace("torch.linalg", torch.linalg)
    offered.device = _cpu
    helpers = SimpleNamespace(**_helpers())
    return SimpleNamespace(
        torch=offered,
        math=SimpleNamespace(**{name: getattr(math, name) for name in surface.MATH}),
        numpy=SimpleNamespace(**{name: numpy_name(name) for name in surface.NUMPY}),
        isaacgym=SimpleNamespace(torch_utils=helpers),
        isaacgymenvs=SimpleNamespace(utils=SimpleNamespace(torch_jit_utils=helpers)),
    )


def _helpers() -> dict[str, Any]:
    return {name: getattr(helper_functions, name) for name in surface.ALL_HELPERS}


def load(program: Program) -> Runner:
    """The program as a function of a mapping that holds its inputs."""
    modules = _modules()
    # torch imports lazily from C through the builtins of the running frame, hence `__import__`; no program may name it.
    allowed = {name: getattr(builtins, name) for name in (*surface.BUILTINS, "__import__")}
    names: dict[str, Any] = {"__builtins__": allowed}
    names.update(_helpers())
    for name, path in program.draft.names.items():
        value: Any = modules
        for part in path.split("."):
            value = getattr(value, part, None)
        names[name] = value
    exec(program.code(), names)  # the gate's plain form: functions and literal constants
    function = names[program.draft.entry.name]
    taken = {*names, *allowed}  # `self.dt` is no reason to overwrite the program's own `dt`
    free = [name for name in program.inputs if name not in taken]

    def run(state: Mapping[str, Any]) -> object:
        names.update({name: state[name] for name in free})
        given = {name: state[name] for name in program.arguments}
        if program.draft.method:
            return function(SimpleNamespace(**{name: state[name] for name in program.inputs}), **given)
        return function(**given)

    return run
