"""What a reward graph may contain: operations of an allow-list, called as torch's schemas say, within bounds.

A graph may come from a confined child, a file or a store, so nothing about it is trusted. Shapes and values are for
`examine`: this module runs nothing.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Any, cast

import torch

from ..types import Arg, Node, Part, RewardGraph
from . import surface

MAX_NODES = 2_000
MAX_CONSTANT = 4_096
COMPONENT_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
MAX_SIZE_PER_WORLD = 4_096
"""Numbers in one value, per world."""
MAX_TOTAL_PER_WORLD = 65_536
"""Numbers in all values together, per world."""
MAX_DIMENSIONS = 8
TORCH_NAMES = {"dtype": surface.DTYPES, "memory_format": surface.words("contiguous_format preserve_format")}
"""Keyword arguments that name an attribute of torch."""

_MAX_INT = 2**63 - 1
_DIMENSIONS = surface.words("dim dims dim0 dim1 dim2")
_MODES = surface.words("none tanh trunc floor")
_SIZES = surface.words("size repeats split_sizes k m n steps")


class GraphError(ValueError):
    """A graph that is not well formed or not allowed. The text says where."""


class IntegerDivision(RuntimeError):
    """A division that could end the process, refused before it ran."""


def operation(op: str) -> Callable[..., Any]:
    """The ATen overload a node names."""
    if op not in surface.ATEN:
        raise GraphError(f"operation {op!r:.40} is not allowed")
    name, _, overload = op.partition(".")
    return getattr(getattr(torch.ops.aten, name), overload)


def refuse_truncation(dividend: Any, divisor: Any, rounding_mode: str | None) -> None:
    """Raises IntegerDivision where integers would be divided and truncated.

    The least integer divided by -1 overflows, and the processor then ends the process. No other allowed operation can
    do that: where a quotient is rounded down, torch checks first.
    """
    exact = (value.is_floating_point() if isinstance(value, torch.Tensor) else isinstance(value, float)
             for value in (dividend, divisor))  # fmt: skip
    if rounding_mode == "trunc" and not any(exact):
        raise IntegerDivision("an integer division that truncates")


def parts(arg: Arg) -> tuple[Part, ...]:
    """The values in an argument, which may itself be one."""
    return arg if isinstance(arg, tuple) else (arg,)


def leaves(node: Node) -> Iterator[Part]:
    """The parts of a node's arguments."""
    for arg in (*node.args, *node.kwargs.values()):
        yield from parts(arg)


def inputs(graph: RewardGraph) -> tuple[str, ...]:
    """Names of the state variables a graph reads."""
    return tuple(str(node.args[0]) for node in graph.nodes if node.op == "input")


def references(node: Node) -> tuple[int, ...]:
    """Indices of the nodes whose values a node uses."""
    # The first test spares tables of numbers the second, which is slow.
    kept = (leaf for leaf in leaves(node) if type(leaf) not in (int, float))
    return tuple(leaf["ref"] for leaf in kept if isinstance(leaf, Mapping) and "ref" in leaf)


def needed(graph: RewardGraph, *outputs: int) -> set[int]:
    """Indices of the given nodes and of all nodes that they depend on."""
    found = set(outputs)
    for index in reversed(range(len(graph.nodes))):
        if index in found:
            found.update(references(graph.nodes[index]))
    return found


def validate(graph: RewardGraph) -> None:
    """Raises GraphError unless every operation is allowed and called properly, and every reference points backwards."""
    if not 0 < len(graph.nodes) <= MAX_NODES:
        raise GraphError(f"{len(graph.nodes)} nodes; between 1 and {MAX_NODES} are allowed")
    for index, node in enumerate(graph.nodes):
        try:
            _validate_node(node, index)
        except GraphError as error:
            raise GraphError(f"node {index}: {error}") from None
    if len(graph.components) > surface.MAX_COMPONENTS:
        raise GraphError(f"{len(graph.components)} components; at most {surface.MAX_COMPONENTS} are allowed")
    names = [name for name, _ in graph.components]
    if len(set(names)) != len(names) or not all(COMPONENT_NAME.fullmatch(name) for name in names):
        raise GraphError("component names must be distinct identifiers")
    for index in (graph.reward, *(index for _, index in graph.components)):
        if type(index) is not int or not 0 <= index < len(graph.nodes):
            raise GraphError(f"output {index!r:.20} is not a node")


def _validate_node(node: Node, index: int) -> None:
    if node.op == "input":
        if len(node.args) != 1 or not isinstance(node.args[0], str) or len(node.args[0]) > 100 or node.kwargs:
            raise GraphError("an input has one name")
    elif node.op == "constant":
        _validate_constant(node)
    elif node.op == "getitem":
        if len(node.args) != 2 or not _is_reference(node.args[0]) or type(node.args[1]) is not int or node.kwargs:
            raise GraphError("getitem takes a node and a position")
    else:
        _validate_call(node)
    for reference in references(node):
        if reference >= index:
            raise GraphError(f"reference {reference} is out of range")


def _validate_constant(node: Node) -> None:
    values, shape, dtype = node.args if len(node.args) == 3 and not node.kwargs else (None, None, None)
    if not isinstance(values, tuple) or not isinstance(shape, tuple) or not _is_name(dtype, surface.DTYPES):
        raise GraphError("a constant has values, a shape and a dtype")
    if len(values) > MAX_CONSTANT or len(shape) > MAX_DIMENSIONS or not all(map(_is_number, values)):
        raise GraphError(f"a constant holds at most {MAX_CONSTANT} numbers in {MAX_DIMENSIONS} dimensions")
    sizes = [size for size in shape if type(size) is int and size >= 0]
    if len(sizes) < len(shape) or math.prod(sizes) != len(values):
        raise GraphError("a constant's shape does not fit its values")


# --- calls -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Parameter:
    accepts: Callable[[Arg], bool]
    positional: bool
    required: bool


def _validate_call(node: Node) -> None:
    parameters = _parameters(node.op)
    positional = [name for name, parameter in parameters.items() if parameter.positional]
    if len(node.args) > len(positional):
        raise GraphError(f"{len(node.args)} arguments; {node.op} takes {len(positional)}")
    given = dict(zip(positional, node.args, strict=False))
    repeated = [name for name in node.kwargs if name in given or name not in parameters]
    if repeated:
        raise GraphError(f"{node.op} takes no argument {repeated[0]!r:.40} here")
    given |= node.kwargs
    for name, parameter in parameters.items():
        if name not in given:
            if parameter.required:
                raise GraphError(f"{node.op} needs the argument {name!r}")
        elif not parameter.accepts(given[name]) or not _within_bounds(name, given[name]):
            raise GraphError(f"{name}={given[name]!r:.40} is not allowed in {node.op}")


@functools.cache
def _parameters(op: str) -> dict[str, _Parameter]:
    """The parameters of an operation, in order, from torch's own schema."""
    schema: Any = operation(op)._schema  # pyright: ignore[reportFunctionMemberAccess]
    return {
        argument.name: _Parameter(
            accepts=_acceptor(argument.name, str(argument.real_type)),
            positional=not argument.kwarg_only,
            required=not argument.has_default_value(),
        )
        for argument in schema.arguments
    }


def _acceptor(name: str, kind: str) -> Callable[[Arg], bool]:
    """A function that tells whether a value has the type that a schema writes as `kind`."""
    if kind.startswith("Optional["):
        inner = _acceptor(name, kind[len("Optional[") : -1])
        return lambda value: value is None or inner(value)
    if kind.startswith("List["):
        inner = _acceptor(name, kind[len("List[") : -1])
        return lambda value: isinstance(value, tuple) and len(value) <= MAX_CONSTANT and all(map(inner, value))
    return _KINDS[kind.replace("SymInt", "int")]


def _is_reference(value: Arg) -> bool:
    return isinstance(value, Mapping) and set(value) == {"ref"} and type(value["ref"]) is int and value["ref"] >= 0


def _is_worlds(value: Arg) -> bool:
    return isinstance(value, Mapping) and set(value) == {"n"} and _is_size(value["n"])


def _is_size(value: Arg) -> bool:
    return type(value) is int and 0 <= value <= MAX_SIZE_PER_WORLD


def _is_number(value: Arg) -> bool:
    return isinstance(value, float) or (isinstance(value, int) and abs(value) <= _MAX_INT)


def _is_name(value: Arg, allowed: Set[str]) -> bool:
    return isinstance(value, str) and value in allowed


_KINDS: Mapping[str, Callable[[Arg], bool]] = {
    "Tensor": lambda value: _is_reference(value) or _is_worlds(value) or _is_number(value),  # torch wraps numbers
    "number": lambda value: _is_worlds(value) or _is_number(value),
    "float": lambda value: _is_worlds(value) or _is_number(value),
    "int": lambda value: _is_worlds(value) or (type(value) is int and abs(value) <= _MAX_INT),
    "bool": lambda value: type(value) is bool,
    "str": lambda value: _is_name(value, _MODES),
    "ScalarType": lambda value: _is_name(value, TORCH_NAMES["dtype"]),
    "MemoryFormat": lambda value: _is_name(value, TORCH_NAMES["memory_format"]),
    "Layout": lambda value: False,
    "Device": lambda value: False,
}


def _within_bounds(name: str, value: Arg) -> bool:
    """Whether dimensions are in range and sizes given as numbers are small. `examine` checks computed sizes."""
    if name in _DIMENSIONS:
        return all(
            part is None or (type(part) is int and -MAX_DIMENSIONS <= part < MAX_DIMENSIONS) for part in parts(value)
        )
    if name in _SIZES:
        # The type was checked before: a whole number, or a multiple of the number of worlds.
        sizes = [part["n"] if isinstance(part, Mapping) else cast(int, part) for part in parts(value)]
        total = math.prod(max(1, size) for size in sizes)
        return len(sizes) <= MAX_CONSTANT and min(sizes, default=0) >= -1 and total <= MAX_TOTAL_PER_WORLD
    return True
