"""The weights and scales in the text of a reward program, and the same text with other numbers in their place.

Text goes in and text comes out: what is between the numbers stays the same to the byte. Before the result trains, it is
judged like any other reward.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Literal, cast

from . import gate, places, surface
from .normalise import entry_name
from .syntax import defaults, stored

Use = Literal["factor", "added", "threshold", "data"]
"""How a number is used: as a factor or divisor, added or passed on, compared with, or none of these."""
THRESHOLD = 0.1
"""Step of a number that is compared with. It is small: a robot is always below twice the height at which it counts as
fallen, and never below half of it."""
GUARD, LARGEST = 1e-5, 1e15
"""An added number up to `GUARD` protects a division from zero; a number from `LARGEST` on stands for infinity."""
_UNTOUCHED = surface.words("""
    clamp clamp_max clamp_min clip float_power full isclose norm nan_to_num pow quantile round vector_norm
""")
"""Functions whose plain numbers are bounds, exponents, orders or the like. Numbers in expressions that are their
arguments still count."""
_DIGITS = rb"\d(?:_?\d)*"
_NUMBER = re.compile(rb"(?:%b\.?(?:%b)?|\.%b)(?:[eE][+-]?%b)?" % ((_DIGITS,) * 4))


@dataclass(frozen=True, slots=True, kw_only=True)
class Weight:
    """One number of a text."""

    name: str
    """The name that the number is assigned to; else the name that its line assigns to, and the number: `effort 0.5`."""
    value: float
    """With its sign."""
    step: float
    """How far its logarithm moves when that of a factor moves by 1."""
    span: tuple[int, int]
    """Where its digits stand in the text as UTF-8 [bytes]."""


def weights(text: str) -> tuple[Weight, ...]:
    """The numbers that may be tuned, in the order of the text, each with a unique name; none if it is no program.

    They are factors, divisors, offsets and thresholds of the reward function, of the functions that it calls and of the
    constants that they read. Whole numbers count as factors and divisors only. These never count: zero, exponents,
    indices, sizes, bounds of a clamp, keyword arguments, elements of a list, and whole numbers that an index or a size
    is computed from.
    """
    tree = gate.parse(text) if len(text) <= gate.MAX_BYTES else None
    if not isinstance(tree, ast.Module):
        return ()
    found = sorted(_Finder(text, tree).found(), key=lambda weight: weight.span)
    names = [weight.name for weight in found]
    counts = [names[:place].count(name) + 1 for place, name in enumerate(names)]
    return tuple(
        replace(weight, name=f"{weight.name} ({count})") if count > 1 else weight
        for weight, count in zip(found, counts, strict=True)
    )


def weighed(text: str, numbers: Sequence[float]) -> str:
    """The text with these numbers in place of its `weights`. Signs stay those of the text; an unchanged number stays as
    it is written. Raises ValueError unless there are as many numbers as weights."""
    data = text.encode()
    for weight, value in reversed(list(zip(weights(text), numbers, strict=True))):
        if value != weight.value:
            start, end = weight.span
            data = data[:start] + repr(abs(float(value))).encode() + data[end:]
    return data.decode()


def values(text: str, origin: str) -> tuple[float, ...] | None:
    """The numbers that `text` has for the `weights` of `origin`; None unless `weighed` made it from `origin`."""
    data, source, place, before = text.encode(errors="replace"), origin.encode(errors="replace"), 0, 0
    found: list[float] = []
    for weight in weights(origin):
        start, end = weight.span
        number = _NUMBER.match(data, place + start - before)
        if number is None or data[place : number.start()] != source[before:start]:
            return None
        found.append(float(number[0]) * (-1.0 if weight.value < 0 else 1.0))
        place, before = number.end(), end
    return tuple(found) if data[place:] == source[before:] and all(map(math.isfinite, found)) else None


class _Finder:
    """Walks the functions that a reward reaches."""

    def __init__(self, text: str, tree: ast.Module) -> None:
        self._data = text.encode()
        self._starts = list(accumulate(map(len, self._data.splitlines(keepends=True)), initial=0))
        self._tree = tree
        self._functions = list(_reached(tree))
        found = [pair for function in self._functions for node in ast.walk(function) for pair in _operands(node)]
        self._uses: dict[str, Use] = {}
        """How names are used by themselves: as `data` if anywhere so, else as a `factor`, else as a `threshold`."""
        for wanted in ("threshold", "factor", "data"):
            self._uses |= {name: use for name, use in found if use == wanted}
        self._places = places.whole(
            self._functions, (node for node in tree.body if not isinstance(node, ast.FunctionDef))
        )

    def found(self) -> Iterator[Weight]:
        read = {name for function in self._functions for name in _names(function)}
        for statement in self._tree.body:
            if isinstance(statement, ast.Assign | ast.AnnAssign) and not read.isdisjoint(stored(statement)):
                yield from self._statement(statement, "")
        for function in self._functions:
            for argument, default in defaults(function):
                yield from self._assigned(argument.arg, default)
            owner = "reward" if function is self._functions[0] else function.name
            for statement in function.body:
                yield from self._statement(statement, owner)

    def _statement(self, node: ast.stmt, owner: str) -> Iterator[Weight]:
        """`owner` is the name for weights of a statement that assigns to nothing."""
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=own)) if len(names) == len(own):
                for name, value in zip(names, own, strict=True):
                    yield from self._assigned(_called(name) or owner, value)
            case ast.Assign(value=value) | ast.AnnAssign(value=ast.expr() as value):
                target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                yield from self._assigned(_called(target) or owner, value)
            case ast.AugAssign(target=target, op=op, value=value):
                yield from self._expression(value, _use(op), _called(target) or owner)
            case ast.FunctionDef():
                for inner in node.body:
                    yield from self._statement(inner, node.name)
            case _:
                for child in ast.iter_child_nodes(node):
                    if isinstance(child, ast.stmt):
                        yield from self._statement(child, owner)
                    elif isinstance(child, ast.expr):
                        yield from self._expression(child, "data", owner)

    def _assigned(self, name: str, value: ast.expr) -> Iterator[Weight]:
        """A plain number assigned to a name is called by that name alone, and its use is that of the name."""
        if isinstance(_plain(value), ast.Constant):
            use = self._uses.get(name, "added")
            found = self._expression(value, use, name, step=THRESHOLD if use == "threshold" else 1.0)
            yield from (replace(weight, name=name) for weight in found)
        else:
            yield from self._expression(value, "added", name)

    def _expression(self, node: ast.AST, use: Use, owner: str, sign: str = "", step: float = 1.0) -> Iterator[Weight]:
        parts: Iterable[tuple[ast.AST, Use]]
        match node:
            case ast.Constant():
                counts = _counts(node.value, use) and node not in self._places
                weight = self._weight(node, owner, sign, step) if counts else None
                if weight is not None:
                    yield weight
                return
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op):
                yield from self._expression(node.operand, use, owner, "-" if isinstance(op, ast.USub) else "", step)
                return
            case ast.BinOp(op=ast.Pow()):
                parts = [(node.left, "data")]
            case ast.BinOp(op=op):
                parts = [(node.left, _use(op)), (node.right, _use(op))]
            case ast.Compare():
                step = THRESHOLD
                parts = [(part, "threshold") for part in (node.left, *node.comparators)]
            case ast.IfExp():
                parts = [(node.test, "data"), (node.body, use), (node.orelse, use)]
            case ast.Dict():
                for key, value in zip(node.keys, node.values, strict=True):
                    yield from self._assigned(_called(key) or owner, value)
                return
            case ast.Subscript():
                parts = [(node.value, "data")]
            case ast.Call():
                parts = _parts(node)
            case _:
                parts = [(child, "data") for child in ast.iter_child_nodes(node)]
        for part, own in parts:
            yield from self._expression(part, own, owner, step=step)

    def _weight(self, node: ast.Constant, owner: str, sign: str, step: float) -> Weight | None:
        assert node.end_lineno is not None and node.end_col_offset is not None  # as ast.parse leaves it
        start = self._starts[node.lineno - 1] + node.col_offset
        end = self._starts[node.end_lineno - 1] + node.end_col_offset
        assert isinstance(node.value, int | float)
        if _NUMBER.fullmatch(self._data, start, end) is None:  # 0x10 is a mask
            return None
        return Weight(
            name=f"{owner} {sign}{self._data[start:end].decode()}",
            value=float(node.value) * (-1.0 if sign else 1.0),
            step=step,
            span=(start, end),
        )


def _reached(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """The reward function, then those that it calls, directly or through each other."""
    known = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    waiting = [entry_name(known)] if known else []
    while waiting:
        function = known.pop(waiting.pop(0), None)
        if function is not None:
            yield function
            waiting += _names(function)


def _operands(node: ast.AST) -> Iterator[tuple[str, Use]]:
    """Names that are by themselves an operand of a comparison (`threshold`), of a product or quotient (`factor`), an
    exponent or an option of a call (`data`), and names anywhere in sizes and indices (`data`)."""
    parts: list[ast.expr] = []
    use: Use = "data"
    match node:
        case ast.Compare():
            parts, use = [node.left, *node.comparators], "threshold"
        case ast.BinOp(op=ast.Mult() | ast.Div()):
            parts, use = [node.left, node.right], "factor"
        case ast.BinOp(op=ast.Pow()):
            parts = [node.right]
        case ast.Call():
            parts = [keyword.value for keyword in node.keywords]
            if places.function(node) in _UNTOUCHED:
                parts += node.args
        case _:
            pass
    for part in map(_plain, parts):
        if isinstance(part, ast.Name):
            yield part.id, use
    for name in places.names(node):
        yield name, "data"


def _names(function: ast.FunctionDef) -> list[str]:
    """Names that a function uses, and attributes of `self`."""
    names: list[str] = []
    for node in ast.walk(function):
        match node:
            case ast.Name(id=name) | ast.Attribute(value=ast.Name(id="self"), attr=name):
                names.append(name)
            case _:
                pass
    return names


def _parts(call: ast.Call) -> Iterator[tuple[ast.AST, Use]]:
    """The parts of a call that may hold weights. A plain number as a keyword argument is an option, as a size is."""
    name = places.function(call)
    yield call.func, "data"
    if name in places.SIZED:
        return
    use: Use = "data" if name in _UNTOUCHED else "added"
    for argument in call.args:
        yield argument, use
    for keyword in call.keywords:
        yield keyword.value, "data"


def _use(op: ast.operator) -> Use:
    if isinstance(op, ast.Mult | ast.Div):
        return "factor"
    return "added" if isinstance(op, ast.Add | ast.Sub) else "data"


def _counts(value: object, use: Use) -> bool:
    """Whether a number with this use weighs or scales."""
    if use == "factor":
        return type(value) in (int, float) and 0 < cast(float, value) < LARGEST
    return use != "data" and type(value) is float and GUARD < value < LARGEST


def _plain(node: ast.expr) -> ast.expr:
    """An expression without its sign."""
    return node.operand if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd) else node


def _called(node: ast.expr | None) -> str:
    """What a person would call the target of an assignment; empty for several."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.Constant(value=str(name)):
            return name
        case ast.Subscript(slice=ast.Constant(value=str(name))):
            return name
        case _:
            return ""
