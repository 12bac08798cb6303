"""What the numbers of a program come to, as in `LIMIT = 12 * math.pi / 180`, without running it."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

from . import surface
from .syntax import dotted

MAX_INT = 2**63
MAX_REPEATED = 100
"""Most numbers and empty lists in the result of a repetition such as `[0.1] * 8`."""
Number = int | float


def _power(a: Number, b: Number) -> Number:
    """a ** b, in floats if it is large: a power of integers could fill the memory."""
    if isinstance(a, int) and isinstance(b, int) and abs(a) <= 2**31 and 0 <= b <= 63 and abs(a**b) <= MAX_INT:
        return a**b
    return math.pow(a, b)


# `operator.truediv` and `floordiv` have no types.
_BINARY: Mapping[type[ast.operator], Callable[[Number, Number], Number]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: lambda a, b: a / b,
    ast.FloorDiv: lambda a, b: a // b,
    ast.Mod: operator.mod,
    ast.Pow: _power,
}
_NUMPY = {
    "arccos": math.acos, "arcsin": math.asin, "arctan": math.atan, "arctan2": math.atan2, "deg2rad": math.radians,
    "newaxis": None, "power": math.pow, "rad2deg": math.degrees,
}  # fmt: skip


def numpy_name(name: str) -> Any:
    """What a name of numpy stands for: a constant, or the function of Python numbers."""
    return _NUMPY[name] if name in _NUMPY else getattr(math, name)


class Folder(ast.NodeTransformer):
    """Replaces arithmetic of numbers, and `float("inf")`, by its result and leaves everything else as it is.

    Args:
        names: name to dotted path, for everything imported.
        constants: literals by name, for everything assigned so far.
    """

    def __init__(self, names: Mapping[str, str], constants: Mapping[str, ast.expr]) -> None:
        self.names, self.constants = names, constants

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        compute, left, right = _BINARY.get(type(node.op)), _number(node.left), _number(node.right)
        if isinstance(node.op, ast.Mult) and (left is None) != (right is None):
            repeated = _repeated(node.left, right) if left is None else _repeated(node.right, left)
            return repeated or node
        if compute is None or left is None or right is None:
            return node
        return _result(node, compute, left, right)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        known = _number(self.constants[node.id]) if node.id in self.constants else None
        return self._constant(node) if known is None else ast.copy_location(ast.Constant(known), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        return self._constant(node)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        match node:
            case ast.Call(func=ast.Name(id="float"), args=[ast.Constant(value=str(text))]) if not node.keywords:
                return _result(node, float, text)
            case _:
                pass
        node.args = [self.visit(argument) for argument in node.args]
        function, numbers = self._math(node.func), [_number(argument) for argument in node.args]
        return node if function is None or node.keywords or None in numbers else _result(node, function, *numbers)

    def _constant(self, node: ast.expr) -> ast.expr:
        value = self._math(node)
        return ast.copy_location(ast.Constant(value), node) if isinstance(value, float) else node

    def _math(self, node: ast.expr) -> Any:
        """What a path into math, numpy or torch's constants stands for; None for all others."""
        root, _, rest = (dotted(node) or "").partition(".")
        module, _, name = f"{self.names.get(root, '')}.{rest}".strip(".").rpartition(".")
        if (module == "math" and name in surface.MATH) or (module == "torch" and name in ("pi", "inf", "nan")):
            return getattr(math, name)
        return numpy_name(name) if module == "numpy" and name in surface.NUMPY else None


def _number(node: ast.expr) -> Number | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        positive = _number(node.operand)
        return None if positive is None else -positive
    value = node.value if isinstance(node, ast.Constant) else None
    return value if isinstance(value, int | float) else None


def _repeated(node: ast.expr, times: Number | None) -> ast.expr | None:
    """A list or tuple of numbers, or of such lists, repeated: `[0.1] * 8`. None for any other, or a long result."""
    if not isinstance(node, ast.List | ast.Tuple) or not isinstance(times, int) or _length(node) * times > MAX_REPEATED:
        return None
    return ast.copy_location(type(node)(node.elts * times, ast.Load()), node)


def _length(node: ast.expr) -> float:
    """How many numbers and empty lists a nested list holds; infinite if it holds anything else."""
    if isinstance(node, ast.List | ast.Tuple):
        return max(1, sum(map(_length, node.elts)))
    return math.inf if _number(node) is None else 1


def _result(node: ast.expr, compute: Callable[..., Number], *numbers: Any) -> ast.expr:
    try:
        value = compute(*numbers)
    except (ArithmeticError, ValueError, TypeError):
        return node
    if isinstance(value, int) and abs(value) > MAX_INT:  # squared line by line it would fill the memory
        return node
    return ast.copy_location(ast.Constant(value), node)
