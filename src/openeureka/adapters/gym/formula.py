"""An expression over numbers of a step, such as `x_velocity - 0.1 * abs(z)`: read as a tree, never run as code."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor

from ...errors import TaskError, nearest

_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: torch.pow,
}
_COMPARE: dict[type, Callable[[Any, Any], Any]] = {
    ast.Lt: torch.lt,
    ast.LtE: torch.le,
    ast.Gt: torch.gt,
    ast.GtE: torch.ge,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(torch, name) for name in ("abs", "sqrt", "exp", "log", "sin", "cos", "tanh")},
    "min": torch.minimum,
    "max": torch.maximum,
}
_LARGEST = torch.finfo(torch.float32).max
_LONGEST = 2000
"""Characters of an expression: Python refuses to print a whole number of many more digits."""
_DEEPEST = 200
"""Levels of nested operations; each term of a sum is one. Each costs a level of Python's own stack."""
Values = Mapping[str, Tensor]
Formula = Callable[[Values], Tensor]


def formula(text: str, shapes: Mapping[str, tuple[int, ...]]) -> tuple[Formula, frozenset[str]]:
    """The expression as a function of named tensors (N, *shape) to (N,) float32, and the names in it.

    It knows numbers, + - * / **, < <= > >= (1 where true, else 0), abs, sqrt, exp, log, sin, cos, tanh, min and max of
    two, and `name[2]` for a column.

    Raises:
        TaskError: for anything else, an unknown name, or a name that has several columns.
    """
    tree = _parsed(text)
    used = _names(tree)
    _check(tree, text, shapes)
    if not used:
        raise TaskError(f"The fitness `{text:.80}` uses nothing of the environment, which has {', '.join(shapes)}.")
    return lambda values: _value(tree, values).to(torch.float32), used


def names(text: str) -> frozenset[str]:
    """The names in an expression, known or not. Raises TaskError if the text is no expression."""
    return _names(_parsed(text))


def _parsed(text: str) -> ast.expr:
    if len(text) > _LONGEST:
        raise TaskError(f"The fitness `{text:.80}` is too long; write at most {_LONGEST} characters.")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise TaskError(
            f"The fitness `{text:.80}` is not an expression; write for example x_velocity - 0.1 * abs(z)."
        ) from None
    level: list[ast.expr] = [tree]
    for _ in range(_DEEPEST):
        level = [inner for node in level for inner in ast.iter_child_nodes(node) if isinstance(inner, ast.expr)]
    if level:
        raise TaskError(
            f"The fitness `{text:.80}` is nested too deeply; write fewer than {_DEEPEST} operations in a row."
        )
    return tree


def _names(tree: ast.expr) -> frozenset[str]:
    return frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name)) - _FUNCTIONS.keys()


def _check(node: ast.expr, text: str, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Raises TaskError unless the node is one number per world."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if value > _LARGEST:
                raise TaskError(f"The fitness `{text:.80}` has a number beyond 3.4e38; write a smaller one.")
        case ast.Name(id=name):
            _expect_known(name, text, shapes)
            if shapes[name]:
                raise TaskError(f"`{name}` in the fitness has the shape {shapes[name]}; name a column: {name}[0].")
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int(column))):
            _expect_known(name, text, shapes)
            if len(shapes[name]) != 1 or column >= shapes[name][0]:
                raise TaskError(f"`{name}` in the fitness has the shape {shapes[name]}, so it has no column {column}.")
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=inner):
            _check(inner, text, shapes)
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _BINARY:
            _check(left, text, shapes)
            _check(right, text, shapes)
        case ast.Compare(left=left, ops=[sign], comparators=[right]) if type(sign) in _COMPARE:
            _check(left, text, shapes)
            _check(right, text, shapes)
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in _FUNCTIONS:
            if len(given) != (2 if name in ("min", "max") else 1):
                raise TaskError(
                    f"`{name}` in the fitness `{text:.80}` takes {'2 values' if name in ('min', 'max') else '1 value'}."
                )
            for inner in given:
                _check(inner, text, shapes)
        case _:
            raise TaskError(
                f"`{ast.unparse(node):.60}` in the fitness `{text:.80}` is not understood; a fitness may have numbers, "
                f"names, + - * / ** < >, and {', '.join(_FUNCTIONS)}."
            )


def _expect_known(name: str, text: str, shapes: Mapping[str, tuple[int, ...]]) -> None:
    if name not in shapes:
        raise TaskError(
            f"The fitness `{text:.80}` uses `{name}`, which the environment did not report in random play."
            f"{nearest(name, shapes)} It reported {', '.join(shapes)}."
        )


def _value(node: ast.expr, values: Values) -> Tensor:
    match node:
        case ast.Constant(value=value):
            return torch.tensor(float(value))  # pyright: ignore[reportArgumentType]  checked to be a number
        case ast.Name(id=name):
            return values[name]
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int(column))):
            return values[name][:, column]
        case ast.UnaryOp(op=sign, operand=inner):
            return -_value(inner, values) if isinstance(sign, ast.USub) else _value(inner, values)
        case ast.BinOp(left=left, op=sign, right=right):
            return _BINARY[type(sign)](_value(left, values), _value(right, values))
        case ast.Compare(left=left, ops=[sign], comparators=[right]):
            return _COMPARE[type(sign)](_value(left, values), _value(right, values)).to(torch.float32)
        case ast.Call(func=ast.Name(id=name), args=given):
            return _FUNCTIONS[name](*(_value(inner, values) for inner in given))
        case _:
            raise AssertionError(ast.dump(node))  # `_check` refused it
