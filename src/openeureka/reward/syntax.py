"""Questions about a syntax tree: which names it uses and binds, and how it reads."""

from __future__ import annotations

import ast
from collections.abc import Iterator

Scope = ast.FunctionDef | ast.Lambda | ast.ListComp | ast.DictComp | ast.GeneratorExp
SCOPES = (ast.FunctionDef, ast.Lambda, ast.ListComp, ast.DictComp, ast.GeneratorExp)


def dotted(node: ast.AST) -> str | None:
    """`a.b.c` of nested attributes, or None."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    if not isinstance(node, ast.Name):
        return None
    return ".".join((node.id, *reversed(parts)))


def shown(node: ast.expr) -> str:
    """How an expression reads, for a message; Python refuses to write an integer of thousands of digits."""
    try:
        return ast.unparse(node)[:60]
    except ValueError:
        return "..."


def identifiers(node: ast.AST) -> Iterator[str]:
    for field in ("id", "attr", "arg", "name"):
        value = getattr(node, field, None)
        if isinstance(value, str):
            yield value


def bound(node: Scope) -> set[str]:
    """Names bound in a function, lambda or comprehension itself, not in those nested in it."""
    names: set[str] = set()
    if isinstance(node, ast.FunctionDef | ast.Lambda):
        arguments = node.args
        names |= {argument.arg for argument in (*arguments.args, *arguments.kwonlyargs)}
        todo: list[ast.AST] = [*node.body] if isinstance(node, ast.FunctionDef) else [node.body]
    else:
        todo = [generator.target for generator in node.generators]
    while todo:
        part = todo.pop()
        if isinstance(part, ast.FunctionDef):
            names.add(part.name)
        elif isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
            names.add(part.id)
        if not isinstance(part, SCOPES):
            todo.extend(ast.iter_child_nodes(part))
    return names


def stored(node: ast.AST) -> set[str]:
    """Names that are assigned anywhere in a node."""
    names = (part for part in ast.walk(node) if isinstance(part, ast.Name))
    return {name.id for name in names if isinstance(name.ctx, ast.Store)}


def rebound(function: ast.FunctionDef) -> set[str]:
    """Names given a new value by a plain assignment. In-place edits of these are left to the probe to judge."""
    assigned = (node for node in ast.walk(function) if isinstance(node, ast.Assign))
    return {name for node in assigned for target in node.targets for name in stored(target)}


def defaults(function: ast.FunctionDef | ast.Lambda) -> Iterator[tuple[ast.arg, ast.expr]]:
    """The arguments that have a default, each with its default."""
    arguments = function.args
    yield from zip(reversed(arguments.args), reversed(arguments.defaults), strict=False)
    for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        if default is not None:
            yield argument, default
