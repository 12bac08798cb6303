"""A task's source as a language model reads it: how actions act and how the state is computed, with what that names.

Two rules keep the goal out. What is shown starts from the methods in `_SHOWN` only. And of what they name, nothing is
shown that the score, the rewards or the end of an episode name too: no number, method or remembered attribute.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

from ..errors import TaskError
from .task import Task

# An allow-list, so that nothing a task adds later (fitness, rewards, thresholds, training defaults) leaks by default.
_SHOWN = ("apply_action", "compute_state", "observe")
_HIDDEN = ("outcome", "fitness", "human_reward", "sparse_reward", "success_bonus", "terminated", "reset")
_OURS = __name__.partition(".")[0]

_MAX_CONSTANT, _MAX_FORMULA = 240, 60  # characters of a value, and of its formula
_MAX_METHOD = 16  # lines
_MAX_FUNCTION = 1  # statements
_GIVEN = "# self.sim.bind(field): MuJoCo's field, of all N environments, live. self.actions: the last actions."


def prune(task: type[Task]) -> str:
    """The task's class, after its base classes, with only the methods that turn actions into motion and motion into
    state. Constants and functions that these methods name come first, and attributes that they name are in the classes.
    """
    return _Source(task).text()


class _Source:
    """Collects what the shown methods name, and what that names in turn."""

    def __init__(self, task: type[Task]) -> None:
        self.task = task
        self.lineage = [cls for cls in reversed(task.__mro__) if issubclass(cls, Task) and cls is not Task]
        self.modules = {cls.__module__ for cls in self.lineage}
        self.above: dict[str, str] = {}
        """Constants, by name."""
        self.functions: dict[str, str] = {}
        self.attributes: dict[tuple[type, str], str] = {}
        self.assigned: dict[type, set[ast.stmt]] = {cls: set() for cls in self.lineage}
        self.methods: dict[tuple[type, str], str] = {}
        self._seen: set[str] = set()
        self._known = _attributes_of_any_task()
        self.private = self._reached_from_hidden()
        for cls in self.lineage:
            for name in _SHOWN:
                if name in vars(cls):
                    self._show_method(cls, name)

    def text(self) -> str:
        above = "\n".join([_GIVEN, *self.above.values(), *self.functions.values()])
        return "\n\n".join([above, *(self._class(cls) for cls in self.lineage)])

    def _class(self, cls: type) -> str:
        bases = ", ".join(base.__name__ for base in cls.__bases__ if base is not Task)
        header = f"class {cls.__name__}({bases}):" if bases else f"class {cls.__name__}:"
        constants = [text for (owner, _), text in self.attributes.items() if owner is cls]
        parts = ["\n".join([header, *constants])]
        if self.assigned[cls]:
            init = _parsed(vars(cls)["__init__"])
            lines = _lines(vars(cls)["__init__"])
            shown = [node for node in init.body if node in self.assigned[cls]]
            body = ["\n".join(lines[node.lineno - 1 : node.end_lineno]) for node in shown]
            parts.append("\n".join(["    def __init__(self, *args):  # in part", *body]))
        order = [name for name in vars(cls) if (cls, name) in self.methods]
        return "\n\n".join([*parts, *(self.methods[cls, name] for name in order)])

    def _show_method(self, cls: type, name: str) -> None:
        function = _function(vars(cls)[name])
        if function is None or (cls, name) in self.methods:
            return
        if name not in _SHOWN and (self._is_private(function) or len(_lines(function)) > _MAX_METHOD):
            docstring = not self._is_private(function)
            self.methods[cls, name] = textwrap.indent(_signature(function, docstring=docstring), "    ")
            return
        self.methods[cls, name] = inspect.getsource(vars(cls)[name]).rstrip()
        self._follow(function, _parsed(function))

    def _follow(self, function: FunctionType, node: ast.AST) -> None:
        """Show what a node of a function names."""
        for name in _attributes(node):
            self._show_attribute(name)
        for name in _names(node):
            if name in function.__globals__ and name not in self._seen:
                self._seen.add(name)
                self._show_global(name, function.__globals__[name], function.__module__)

    def _show_global(self, name: str, value: Any, module: str) -> None:
        if isinstance(value, type | FunctionType):
            if not (value.__module__.startswith(f"{_OURS}.") or value.__module__ in self.modules):
                return
            if isinstance(value, type):
                if not issubclass(value, Task) and value.__doc__:
                    self.functions[name] = f'class {name}: """{_first(value.__doc__)}"""'
                return
            private = value.__module__ in self.modules and (name in self.private or self._is_private(value))
            statements = [node for node in _parsed(value).body if not _is_docstring(node)]
            if private or len(statements) > _MAX_FUNCTION:
                self.functions[name] = _signature(value, docstring=not private)
            else:
                self.functions[name] = inspect.getsource(value).rstrip()
                self._follow(value, _parsed(value))
        elif name not in self.private and (text := _constant(name, value, module)):
            self.above[name] = text

    def _show_attribute(self, name: str) -> None:
        if name in self._seen or name in self._known:
            return
        owner = next((cls for cls in self.task.__mro__ if name in vars(cls)), None)
        if owner is not None and _function(vars(owner)[name]) is not None:
            for cls in self.lineage:
                if name in vars(cls):
                    self._show_method(cls, name)
            return
        self._seen.add(name)
        if name in self.private and not self._is_bound(name):
            return
        if owner is not None:
            value = vars(owner)[name]
            if _is_plain(value) and len(repr(value)) <= _MAX_CONSTANT:
                place = owner if owner in self.lineage else self.lineage[-1]
                self.attributes[place, name] = f"    {name} = {_rounded(value)!r}"
            return
        for cls in self.lineage:
            init = _function(vars(cls).get("__init__"))
            for node in _assigning(init, name) if init else ():
                self._show_assignment(cls, init, node)

    def _show_assignment(self, cls: type, init: FunctionType | None, node: ast.stmt) -> None:
        """Show a statement of `__init__`, and those before it that assign its local variables."""
        if init is None or node in self.assigned[cls]:
            return
        self.assigned[cls].add(node)
        for name in _names(node):
            for other in _parsed(init).body:
                if isinstance(other, ast.Assign) and other.lineno < node.lineno and name in _local_targets(other):
                    self._show_assignment(cls, init, other)
        self._follow(init, node)

    def _is_bound(self, name: str) -> bool:
        """Whether an attribute is a field of the simulator, which anything may read."""
        inits = (_function(vars(cls).get("__init__")) for cls in self.lineage)
        return any(".bind(" in ast.unparse(node) for init in inits if init for node in _assigning(init, name))

    def _is_private(self, function: FunctionType) -> bool:
        """Whether the hidden methods use a function, or it names what they name."""
        node = _parsed(function)
        touched = {name for name in (*_attributes(node), *_stores(node)) if name not in self._known}
        if touched & {name for name in self.private if not self._is_bound(name)}:
            return True
        own = {name for name in _names(node) if self._is_own(function.__globals__.get(name), name, function)}
        return function.__name__ in self.private or bool(own & self.private)

    def _is_own(self, value: Any, name: str, function: FunctionType) -> bool:
        """Whether a global belongs to the task, not to the helpers of all tasks."""
        if isinstance(value, type | FunctionType):
            return value.__module__ in self.modules
        return name in function.__globals__ and not isinstance(value, ModuleType)

    def _reached_from_hidden(self) -> set[str]:
        """Names of the task's own that its score, rewards and terminations use, also through each other.

        What a reset uses is not among them: limits, start poses and the like are no secret.
        """
        found: set[str] = set()
        waiting = [name for name in _HIDDEN if name != "reset"]
        while waiting:
            name = waiting.pop()
            for cls in self.lineage:
                function = _function(vars(cls).get(name))
                if function is not None:
                    waiting += self._new(function, found)
        return found | set(_HIDDEN)

    def _new(self, function: FunctionType, found: set[str]) -> Iterator[str]:
        node = _parsed(function)
        for name in (*_attributes(node), *_stores(node)):
            if name not in found and name not in self._known:
                found.add(name)
                yield name
        for name in _names(node):
            value = function.__globals__.get(name)
            if name not in found and self._is_own(value, name, function):
                found.add(name)
                if isinstance(value, FunctionType):
                    yield from self._new(value, found)


@cache
def _attributes_of_any_task() -> frozenset[str]:
    """Names of attributes that every task has, whatever it is about."""
    init = _parsed(Task.__init__)
    return frozenset(_stores(init)) | {"control_dt", "spec"}


def _function(value: Any) -> FunctionType | None:
    value = value.__func__ if isinstance(value, staticmethod | classmethod) else value
    return value if isinstance(value, FunctionType) else None


@cache
def _parsed(function: Callable[..., Any]) -> ast.FunctionDef:
    """Raises TaskError for a lambda, whose source is that of the statement around it."""
    if function.__name__ == "<lambda>":
        code = function.__code__
        raise TaskError(f"{code.co_filename}, line {code.co_firstlineno}: use `def` in place of `lambda`.")
    node = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(node, ast.FunctionDef)
    return node


def _lines(function: Callable[..., Any]) -> list[str]:
    """Lines of a function's source, as in its file."""
    return inspect.getsource(function).splitlines()


def _attributes(node: ast.AST, context: type[ast.expr_context] = ast.Load) -> list[str]:
    """`x` of each `self.x` that is read, or written."""
    own = [part for part in ast.walk(node) if isinstance(part, ast.Attribute) and isinstance(part.ctx, context)]
    return [part.attr for part in own if isinstance(part.value, ast.Name) and part.value.id == "self"]


def _stores(node: ast.AST) -> list[str]:
    return _attributes(node, ast.Store)


def _names(node: ast.AST) -> list[str]:
    """Names that are read, without annotations and without a function's own variables."""
    if isinstance(node, ast.FunctionDef):
        own = {argument.arg for argument in (*node.args.args, *node.args.kwonlyargs)}
        own |= {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
        return [name for statement in node.body for name in _names(statement) if name not in own]
    return [part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load)]


def _assigning(init: FunctionType, name: str) -> list[ast.stmt]:
    """Statements of `__init__` that set `self.name`."""
    assignments = (ast.Assign, ast.AnnAssign)
    return [node for node in _parsed(init).body if isinstance(node, assignments) and name in _stores(node)]


def _local_targets(node: ast.Assign) -> set[str]:
    parts = (part for target in node.targets for part in ast.walk(target))
    return {part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _signature(function: FunctionType, *, docstring: bool) -> str:
    text = function.__doc__ if docstring else None
    arguments = ", ".join(inspect.signature(function).parameters)
    return f"def {function.__name__}({arguments}): " + (f'"""{_first(text)}"""' if text else "...")


def _first(docstring: str) -> str:
    """The first sentence, on one line."""
    paragraph = " ".join(inspect.cleandoc(docstring).split("\n\n")[0].split())
    return re.split(r"(?<=[.:]) (?=[A-Z])", paragraph)[0]


def _constant(name: str, value: Any, module: str) -> str:
    """`NAME = value  # what its line says`; nothing for what is no short plain value."""
    if not _is_plain(value) or len(repr(value)) > _MAX_CONSTANT:
        return ""
    return f"{name} = {_rounded(value)!r}{_comment(name, module)}"


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


def _comment(name: str, module: str) -> str:
    """The comment behind a module's constant, or its formula; where the module imports it, those of its origin."""
    lines, body = _module(module)
    for node in body:
        if isinstance(node, ast.ImportFrom) and name in (alias.name for alias in node.names):
            package = module.split(".")[: -node.level] if node.level else []
            return _comment(name, ".".join([*package, *([node.module] if node.module else [])]))
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.lineno == node.end_lineno:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if [target.id for target in targets if isinstance(target, ast.Name)] == [name]:
                line = lines[node.lineno - 1]
                _, mark, said = line[node.end_col_offset or 0 :].partition("#")  # columns are bytes: this is ASCII
                formula = ast.unparse(node.value) if node.value is not None and not mark else ""
                short = "math." in formula and len(formula) <= _MAX_FORMULA
                return f"  # {said.strip()}" if mark else f"  # {formula}" if short else ""
    return ""
