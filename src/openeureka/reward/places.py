"""Indices and sizes in a reward program: a number there is no weight, and changing it breaks the program."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence

from . import surface
from .syntax import stored

_MADE = surface.words("arange empty expand eye int linspace new_full new_ones new_zeros one_hot ones range view zeros")
_OF_TENSOR = surface.words("""
    chunk full_like gather narrow permute repeat reshape roll select split tile unflatten
""")
"""Functions whose first argument is a tensor when they are called as `torch.NAME`."""
SIZED = _MADE | _OF_TENSOR
"""Functions whose arguments are sizes, indices and counts."""
_CHOOSING = surface.words("""
    argmax argmin argsort bucketize count_nonzero dim int len long nonzero numel searchsorted size sort topk
""")
"""Functions that turn any numbers into whole numbers."""

Flow = tuple[str, ast.expr]
"""A name and an expression that may give its value: assigned to it, looped over, passed as it, or returned by it."""


def function(call: ast.Call) -> str:
    """The last part of the name that is called: `zeros` for `torch.zeros(3)`."""
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def names(node: ast.AST) -> Iterator[str]:
    """Names from which the indices and sizes of this node itself, not of its parts, are computed."""
    match node:
        case ast.Subscript(slice=place):
            yield from _named(place)
        case ast.Call() if (name := function(node)) in SIZED:
            of_tensor = name == "full_like" or (name in _OF_TENSOR and _base(node.func) == "torch")
            for argument in (*node.args[of_tensor:], *(keyword.value for keyword in node.keywords)):
                yield from _named(argument)
        case _:
            pass


def whole(functions: Sequence[ast.FunctionDef], constants: Iterable[ast.stmt]) -> set[ast.AST]:
    """The whole numbers from which indices and sizes are computed, through any chain of names.

    Args:
        functions: the reward function and all that it calls.
        constants: the statements outside of functions.
    """
    trees = [*functions, *constants]
    flows: dict[str, list[ast.expr]] = {}
    for name, value in _flows(functions, trees):
        flows.setdefault(name, []).append(value)
    waiting = [name for tree in trees for node in ast.walk(tree) for name in names(node)]
    found: set[ast.AST] = set()
    while waiting:
        for value in flows.pop(waiting.pop(), ()):
            found.update(part for part in _parts(value) if isinstance(part, ast.Constant) and type(part.value) is int)
            waiting += _named(value)
    return found


def _named(place: ast.expr) -> Iterator[str]:
    """Names in an expression, including functions that it calls."""
    for node in _parts(place):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Call) and _base(node.func) == "self":
            yield function(node)


def _parts(place: ast.expr) -> Iterator[ast.AST]:
    """The nodes of an expression, except those that may be any number: operands of a comparison, as in
    `x[height < LOW]`; arguments of functions that choose or round to whole numbers; tensors of which an attribute such
    as the shape is read; and a dict, because a loop goes over its keys.
    """
    todo: list[ast.AST] = [place]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.Compare | ast.Attribute | ast.Dict):
            continue
        if isinstance(node, ast.Call) and function(node) in _CHOOSING:
            continue
        yield node
        todo += ast.iter_child_nodes(node)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            todo.append(node.func.value)  # `x.sum()` reads x; its attribute was called, not read


def _flows(functions: Sequence[ast.FunctionDef], trees: Iterable[ast.AST]) -> Iterator[Flow]:
    own = {function.name: function for function in functions}
    for tree in trees:
        for node in ast.walk(tree):
            match node:
                case ast.Assign(targets=targets, value=value):
                    for target in targets:
                        yield from _assigned(target, value)
                case (
                    ast.AnnAssign(target=target, value=ast.expr() as value)
                    | ast.AugAssign(target=target, value=value)
                    | ast.NamedExpr(target=target, value=value)
                    | ast.For(target=target, iter=value)
                    | ast.comprehension(target=target, iter=value)
                ):
                    yield from _assigned(target, value)
                case ast.Call() if (called := own.get(function(node))) is not None:
                    taken = [argument.arg for argument in called.args.args if argument.arg != "self"]
                    yield from zip(taken, node.args, strict=False)
                    yield from ((keyword.arg, keyword.value) for keyword in node.keywords if keyword.arg is not None)
                case ast.FunctionDef(name=name):
                    for inner in ast.walk(node):
                        if isinstance(inner, ast.Return) and inner.value is not None:
                            yield name, inner.value
                case _:
                    pass


def _assigned(target: ast.expr, value: ast.expr) -> Iterator[Flow]:
    """Each target with its own value, if both are written as tuples; else each name with the whole value."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        for part, own in zip(target.elts, value.elts, strict=True):
            yield from _assigned(part, own)
    else:
        yield from ((name, value) for name in stored(target))


def _base(called: ast.expr) -> str:
    """`x` for the expression `x.name`; empty for any other expression."""
    return called.value.id if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) else ""
