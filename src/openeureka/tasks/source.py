"""A task's source as a language model reads it: how actions act and how the state is computed, with what that names.

Two rules keep the goal out. What is shown starts from the methods in `_SHOWN` only. And of what they name, nothing is
shown that the score, the rewards or the end of an episode name too: no number, method or remembered attribute.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

from . import syntax
from .task import Task

# An allow-list, so that nothing a task adds later (fitness, rewards, thresholds, training defaults) leaks by default.
_SHOWN = ("apply_action", "compute_state", "observe")
_HIDDEN = ("outcome", "fitness", "human_reward", "sparse_reward", "success_bonus", "terminated", "reset")
_OURS = __name__.partition(".")[0]

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
            init = syntax.parsed(vars(cls)["__init__"])
            lines = syntax.source_lines(vars(cls)["__init__"])
            shown = [node for node in init.body if node in self.assigned[cls]]
            body = ["\n".join(lines[node.lineno - 1 : node.end_lineno]) for node in shown]
            parts.append("\n".join(["    def __init__(self, *args):  # in part", *body]))
        order = [name for name in vars(cls) if (cls, name) in self.methods]
        return "\n\n".join([*parts, *(self.methods[cls, name] for name in order)])

    def _show_method(self, cls: type, name: str) -> None:
        function = syntax.function_of(vars(cls)[name])
        if function is None or (cls, name) in self.methods:
            return
        if name not in _SHOWN and (self._is_private(function) or len(syntax.source_lines(function)) > _MAX_METHOD):
            docstring = not self._is_private(function)
            self.methods[cls, name] = textwrap.indent(syntax.signature(function, docstring=docstring), "    ")
            return
        self.methods[cls, name] = inspect.getsource(vars(cls)[name]).rstrip()
        self._follow(function, syntax.parsed(function))

    def _follow(self, function: FunctionType, node: ast.AST) -> None:
        """Show what a node of a function names."""
        for name in syntax.attributes(node):
            self._show_attribute(name)
        for name in syntax.names(node):
            if name in function.__globals__ and name not in self._seen:
                self._seen.add(name)
                self._show_global(name, function.__globals__[name], function.__module__)

    def _show_global(self, name: str, value: Any, module: str) -> None:
        if isinstance(value, type | FunctionType):
            if not (value.__module__.startswith(f"{_OURS}.") or value.__module__ in self.modules):
                return
            if isinstance(value, type):
                if not issubclass(value, Task) and value.__doc__:
                    self.functions[name] = f'class {name}: """{syntax.first_sentence(value.__doc__)}"""'
                return
            private = value.__module__ in self.modules and (name in self.private or self._is_private(value))
            node = syntax.parsed(value)
            statements = len(node.body) - (ast.get_docstring(node) is not None)
            if private or statements > _MAX_FUNCTION:
                self.functions[name] = syntax.signature(value, docstring=not private)
            else:
                self.functions[name] = inspect.getsource(value).rstrip()
                self._follow(value, node)
        elif name not in self.private and (text := syntax.literal(value)):
            self.above[name] = f"{name} = {text}{syntax.comment(name, module)}"

    def _show_attribute(self, name: str) -> None:
        if name in self._seen or name in self._known:
            return
        owner = next((cls for cls in self.task.__mro__ if name in vars(cls)), None)
        if owner is not None and syntax.function_of(vars(owner)[name]) is not None:
            for cls in self.lineage:
                if name in vars(cls):
                    self._show_method(cls, name)
            return
        self._seen.add(name)
        if name in self.private and not self._is_bound(name):
            return
        if owner is not None:
            if text := syntax.literal(vars(owner)[name]):
                place = owner if owner in self.lineage else self.lineage[-1]
                self.attributes[place, name] = f"    {name} = {text}"
            return
        for cls in self.lineage:
            if init := syntax.function_of(vars(cls).get("__init__")):
                for node in syntax.assignments(init, name):
                    self._show_assignment(cls, init, node)

    def _show_assignment(self, cls: type, init: FunctionType, node: ast.stmt) -> None:
        """Show a statement of `__init__`, and those before it that assign its local variables."""
        if node in self.assigned[cls]:
            return
        self.assigned[cls].add(node)
        for name in syntax.names(node):
            for other in syntax.parsed(init).body:
                if isinstance(other, ast.Assign) and other.lineno < node.lineno and name in syntax.local_targets(other):
                    self._show_assignment(cls, init, other)
        self._follow(init, node)

    def _is_bound(self, name: str) -> bool:
        """Whether an attribute is a field of the simulator, which anything may read."""
        inits = (syntax.function_of(vars(cls).get("__init__")) for cls in self.lineage)
        return any(".bind(" in ast.unparse(node) for init in inits if init for node in syntax.assignments(init, name))

    def _is_private(self, function: FunctionType) -> bool:
        """Whether the hidden methods use a function, or it names what they name."""
        node = syntax.parsed(function)
        touched = self.private.intersection(syntax.attributes(node, ast.expr_context)) - self._known
        if not all(map(self._is_bound, touched)):
            return True
        own = {name for name in syntax.names(node) if self._is_own(function.__globals__.get(name), name, function)}
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
                function = syntax.function_of(vars(cls).get(name))
                if function is not None:
                    waiting += self._new(function, found)
        return found | set(_HIDDEN)

    def _new(self, function: FunctionType, found: set[str]) -> Iterator[str]:
        node = syntax.parsed(function)
        for name in syntax.attributes(node, ast.expr_context):
            if name not in found and name not in self._known:
                found.add(name)
                yield name
        for name in syntax.names(node):
            value = function.__globals__.get(name)
            if name not in found and self._is_own(value, name, function):
                found.add(name)
                if isinstance(value, FunctionType):
                    yield from self._new(value, found)


@cache
def _attributes_of_any_task() -> frozenset[str]:
    """Names of attributes that every task has, whatever it is about."""
    init = syntax.parsed(Task.__init__)
    return frozenset(syntax.attributes(init, ast.Store)) | {"control_dt", "spec"}
