"""A task's Python read as syntax: what its functions name, and functions and constants in short."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Mapping
from functools import cache
from types import FunctionType
from typing import Any

from ..errors import TaskError

_MAX_CONSTANT, _MAX_FORMULA = 240, 60  # characters of a value, and of its formula


def function_of(value: Any) -> FunctionType | None:
    """The function behind an entry of a class; None where it is something else."""
    value = value.__func__ if isinstance(value, staticmethod | classmethod) else value
    return value if isinstance(value, FunctionType) else None


@cache
def parsed(function: Callable[..., Any]) -> ast.FunctionDef:
    """Raises TaskError for a lambda, whose source is that of the statement around it."""
    if function.__name__ == "<lambda>":
        code = function.__code__
        raise TaskError(f"{code.co_filename}, line {code.co_firstlineno}: use `def` in place of `lambda`.")
    node = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(node, ast.FunctionDef)
    return node


def source_lines(function: Callable[..., Any]) -> list[str]:
    """Lines of a function's source, as in its file."""
    return inspect.getsource(function).splitlines()


def attributes(node: ast.AST, context: type[ast.expr_context] = ast.Load) -> list[str]:
    """`x` of each `self.x` in this context: read, written (`ast.Store`), or both (`ast.expr_context`)."""
    own = [part for part in ast.walk(node) if isinstance(part, ast.Attribute) and isinstance(part.ctx, context)]
    return [part.attr for part in own if isinstance(part.value, ast.Name) and part.value.id == "self"]


def names(node: ast.AST) -> list[str]:
    """Names that are read, without annotations and without a function's own variables."""
    if isinstance(node, ast.FunctionDef):
        own = {argument.arg for argument in (*node.args.args, *node.args.kwonlyargs)}
        own |= {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
        return [name for statement in node.body for name in names(statement) if name not in own]
    return [part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load)]


def assignments(init: FunctionType, name: str) -> list[ast.stmt]:
    """Statements of `__init__` that set `self.name`."""
    found = [node for node in parsed(init).body if isinstance(node, ast.Assign | ast.AnnAssign)]
    return [node for node in found if name in attributes(node, ast.Store)]


def local_targets(node: ast.Assign) -> set[str]:
    """Variables that an assignment sets, without attributes."""
    parts = (part for target in node.targets for part in ast.walk(target))
    return {part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}


def signature(function: FunctionType, *, docstring: bool) -> str:
    """The function without its body, on one line."""
    text = function.__doc__ if docstring else None
    arguments = ", ".join(inspect.signature(function).parameters)
    return f"def {function.__name__}({arguments}): " + (f'"""{first_sentence(text)}"""' if text else "...")


def first_sentence(docstring: str) -> str:
    """The first sentence, on one line."""
    paragraph = " ".join(inspect.cleandoc(docstring).split("\n\n")[0].split())
    return re.split(r"(?<=[.:]) (?=[A-Z])", paragraph)[0]


def literal(value: Any) -> str:
    """A short plain value as Python, numbers with six digits; empty for any other value."""
    return repr(_rounded(value)) if _is_plain(value) and len(repr(value)) <= _MAX_CONSTANT else ""


def _is_plain(value: Any) -> bool:
    if isinstance(value, tuple | list):
        return all(map(_is_plain, value))
    if isinstance(value, Mapping):
        return all(_is_plain(item) for pair in value.items() for item in pair)
    return isinstance(value, bool | int | float | str | slice)


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, tuple) and type(value) is tuple:
        return tuple(map(_rounded, value))
    return value


@cache
def _module(name: str) -> tuple[list[str], list[ast.stmt]]:
    """Lines and statements of a module; none where it has no file."""
    try:
        source = inspect.getsource(sys.modules[name])
    except (KeyError, OSError, TypeError):
        return [], []
    return source.splitlines(), ast.parse(source).body


def comment(name: str, module: str) -> str:
    """The comment behind a module's constant, or its formula; where the module imports it, those of its origin."""
    lines, body = _module(module)
    for node in body:
        if isinstance(node, ast.ImportFrom) and name in (alias.name for alias in node.names):
            package = module.split(".")[: -node.level] if node.level else []
            return comment(name, ".".join([*package, *([node.module] if node.module else [])]))
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.lineno == node.end_lineno:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if [target.id for target in targets if isinstance(target, ast.Name)] == [name]:
                line = lines[node.lineno - 1]
                _, mark, said = line[node.end_col_offset or 0 :].partition("#")  # columns are bytes: this is ASCII
                formula = ast.unparse(node.value) if node.value is not None and not mark else ""
                short = "math." in formula and len(formula) <= _MAX_FORMULA
                return f"  # {said.strip()}" if mark else f"  # {formula}" if short else ""
    return ""
