"""Questions to a piece of a program: which names it says and binds, and how it reads."""

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
    """Names bound in a function, lambda or comprehension itself, and not in those within it."""
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


def rebound(function: ast.FunctionDef) -> set[str]:
    """Names given a new value by a plain assignment; the probe judges edits of these."""
    targets = [target for node in ast.walk(function) if isinstance(node, ast.Assign) for target in node.targets]
    names = [name for target in targets for name in ast.walk(target)]
    return {name.id for name in names if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)}
