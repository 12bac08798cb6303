"""The human reward of a task as a program that a model can read, derived from the task's own source.

`human_reward` becomes `compute_reward`; the methods and functions that it calls become helpers; state variables become
arguments, and what the task holds besides, constants. Whatever depends on the past cannot be written so.
"""

from __future__ import annotations

import ast
import copy
import inspect
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

from torch import Tensor

from ..errors import TaskError
from .registry import make
from .task import Task

_OPENING = "import torch\nimport math\n"
_WORLDS = 5
"""So that a tensor with a world axis is told from others, whose sizes are 1 to 4 or far larger."""


class _Inexpressible(Exception):
    """What a reward program cannot hold; the text names it."""


@cache
def program(env: str) -> str:
    """The reward that its original authors wrote, as Python source.

    Raises:
        TaskError: when it needs more than the state variables.
    """
    task = make(env, worlds=_WORLDS, threads=1).task
    writer = _Writer(task)
    try:
        reward = writer.helper(type(task).human_reward, {}, name="compute_reward")
    except (_Inexpressible, OSError) as reason:  # OSError: its source is not a file
        raise TaskError(
            f"The human reward of {env} cannot be written as a program ({reason}); write one yourself: init=FILE.py."
        ) from None
    _name_terms(writer.functions[reward.name])
    constants = [f"{name} = {value!r}" for name, value in writer.constants.items()]
    functions = [ast.unparse(ast.fix_missing_locations(function)) for function in writer.functions.values()]
    return "\n\n".join([_OPENING + "\n".join(constants), *functions]) + "\n"


@dataclass(frozen=True, slots=True)
class _Helper:
    """A function of the program."""

    name: str
    reads: tuple[str, ...]
    """State variables, its first arguments."""


@dataclass(slots=True)
class _Writer:
    """Collects what the program consists of, callees before their callers."""

    task: Task
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    constants: dict[str, object] = field(default_factory=dict)
    _helpers: dict[str, _Helper] = field(default_factory=dict)

    def helper(self, function: Callable[..., Any], bound: Mapping[str, str], name: str = "") -> _Helper:
        """Translate a function once for each choice of the texts among its arguments."""
        name = "_".join([name or function.__name__.strip("_"), *bound.values()])
        if name not in self._helpers:
            tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
            assert isinstance(tree, ast.FunctionDef)
            translation = _Translation(self, function.__globals__, tree, bound)
            translated = translation.function(tree, name)
            self.functions[name] = translated
            self._helpers[name] = _Helper(name, tuple(translation.reads))
        return self._helpers[name]

    def constant(self, name: str, value: object) -> ast.expr:
        """A named number or list of the program."""
        tensor = isinstance(value, Tensor)
        plain = value.tolist() if isinstance(value, Tensor) else value
        if not isinstance(plain, int | float | list | tuple):
            raise _Inexpressible(f"it uses `{name}`")
        name = re.sub(r"\W", "", name).strip("_").upper()
        if self.constants.setdefault(name, plain) != plain:
            raise _Inexpressible(f"it uses two different values called `{name}`")
        reference = ast.Name(name, ast.Load())
        return _call("torch.tensor", reference) if tensor else reference


class _Translation(ast.NodeTransformer):
    """One function: `s["x"]` becomes `x`, and what is known beforehand becomes its value."""

    def __init__(
        self, writer: _Writer, surroundings: Mapping[str, Any], tree: ast.FunctionDef, bound: Mapping[str, str]
    ) -> None:
        self._writer = writer
        self._surroundings = surroundings
        self._known: dict[str, Any] = dict(bound)
        self._locals = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)} | {
            node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        }
        self.reads: dict[str, None] = {}

    def function(self, tree: ast.FunctionDef, name: str) -> ast.FunctionDef:
        kept = [arg for arg in tree.args.args if arg.arg not in ("self", "s", *self._known)]
        body = [made for statement in tree.body if (made := self.visit(statement)) is not None]
        for argument in kept:
            argument.annotation, argument.arg = None, self._renamed(argument.arg)
        tree.args.args = [*(ast.arg(read) for read in self.reads), *kept]
        tree.args.defaults = tree.args.defaults[-len(kept) :] if kept else []
        return ast.FunctionDef(name=name, args=tree.args, body=body, decorator_list=[], returns=None)  # pyright: ignore

    def _value(self, node: ast.AST) -> Any:
        """What an expression is before any world is known. Raises NameError when it depends on the state."""
        names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        unknown = (self._locals - {"self"} - set(self._known)) & names
        if unknown or any(isinstance(part, ast.Call) for part in ast.walk(node)):
            raise NameError(f"{unknown}")
        around = {**self._surroundings, "self": self._writer.task, **self._known}
        assert isinstance(node, ast.expr)
        return eval(compile(ast.Expression(ast.fix_missing_locations(copy.deepcopy(node))), "", "eval"), around)

    def _renamed(self, name: str) -> str:
        """A local that is called like a state variable gets another name."""
        return f"{name}_value" if name in self._writer.task.spec and name in self._locals else name

    # --- expressions ---

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        if not (isinstance(node.value, ast.Name) and node.value.id == "s"):
            return self.generic_visit(node)
        name = self._value(node.slice)
        self.reads[name] = None
        return ast.Name(name, ast.Load())

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id in self._locals:
            return ast.Name(self._renamed(node.id), node.ctx)
        value = self._surroundings.get(node.id)
        if value is None or isinstance(value, ModuleType | FunctionType):
            return node
        return self._writer.constant(node.id, value)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if not (isinstance(node.value, ast.Name) and node.value.id == "self"):
            return self.generic_visit(node)
        if node.attr in self._writer.task.memory():
            raise _Inexpressible(f"it depends on the past, through `{node.attr}`")
        return self._writer.constant(node.attr, getattr(self._writer.task, node.attr))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        function = self._own_function(node.func)
        if function is None:
            return self.generic_visit(node)
        signature = inspect.signature(function)
        arguments = [ast.Name("self", ast.Load()), *node.args] if "self" in signature.parameters else node.args
        given = signature.bind(*arguments, **{word.arg: word.value for word in node.keywords if word.arg})
        rest = {name: value for name, value in given.arguments.items() if name not in ("self", "s")}
        texts = {name: text for name, value in rest.items() if isinstance(text := self._text(value), str)}
        helper = self._writer.helper(function, texts)
        self.reads |= dict.fromkeys(helper.reads)
        state = [ast.Name(read, ast.Load()) for read in helper.reads]
        others = [self.visit(value) for name, value in rest.items() if name not in texts]
        return ast.Call(ast.Name(helper.name, ast.Load()), [*state, *others], [])

    def _own_function(self, node: ast.expr) -> Callable[..., Any] | None:
        """The method or function of a task's module that is called; None for one of torch or of a tensor."""
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
            return getattr(type(self._writer.task), node.attr)
        value = self._surroundings.get(node.id) if isinstance(node, ast.Name) else None
        return value if isinstance(value, FunctionType) else None

    def _text(self, node: ast.expr) -> object:
        try:
            return self._value(node)
        except NameError:
            return None

    def visit_ListComp(self, node: ast.ListComp) -> ast.AST:
        """A list over names of state variables is written out."""
        (loop,) = node.generators
        values = self._text(loop.iter)
        if not (isinstance(loop.target, ast.Name) and isinstance(values, tuple | list | dict)):
            return self.generic_visit(node)
        written = []
        for value in values:
            self._known[loop.target.id] = value
            written.append(self.visit(copy.deepcopy(node.elt)))
        return ast.List(written, ast.Load())

    # --- statements ---

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        """Names of state variables that get names of their own are followed, not written."""
        (target,) = node.targets
        values = self._text(node.value)
        if isinstance(target, ast.Tuple) and isinstance(values, tuple) and all(isinstance(v, str) for v in values):
            names = [part.id for part in target.elts if isinstance(part, ast.Name)]
            self._known |= dict(zip(names, values, strict=True))
            return None
        return self.generic_visit(node)


# --- components ------------------------------------------------------------------------------------------------------


def _name_terms(function: ast.FunctionDef) -> None:
    """Return the terms of the sum that the reward is as its components: their curves are the model's feedback."""
    last = function.body[-1]
    if not isinstance(last, ast.Return) or last.value is None:
        raise _Inexpressible("it does not end with `return`")
    assigned = {ast.unparse(s.targets[0]): s for s in function.body if isinstance(s, ast.Assign)}
    holder: ast.Assign | ast.Return = last
    ended = last.value if isinstance(last.value, ast.Call) and ast.unparse(last.value.func) == "torch.where" else None
    total = last.value if ended is None else ended.args[-1]  # at the end of an episode, the sum is not what counts
    terms = _Terms()
    if isinstance(total, ast.Name) and total.id in assigned:
        holder = assigned.pop(total.id)
        holder.value = terms.named(holder.value)
    elif ended is not None:
        ended.args[-1] = terms.named(total)
    else:
        last.value = terms.named(total)
    names = terms.names
    if len(names) == 1:  # not a sum: what it was made from says more
        names = {name: name for name in assigned if name.isidentifier()} or names
    function.body[function.body.index(holder) : function.body.index(holder)] = terms.assignments
    components = ast.Dict([ast.Constant(key) for key in names], [ast.Name(name, ast.Load()) for name in names.values()])
    last.value = ast.Tuple([last.value, components], ast.Load())


class _Terms:
    """The terms of a sum, without constant factors; those that are expressions get variables."""

    def __init__(self) -> None:
        self.names: dict[str, str] = {}
        """Variable by component."""
        self.assignments: list[ast.stmt] = []

    def named(self, node: ast.expr) -> ast.expr:
        """The same value, written with names for its terms."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            return ast.BinOp(self.named(node.left), node.op, self.named(node.right))
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            if _is_number(node.left):
                return ast.BinOp(node.left, node.op, self.named(node.right))
            if _is_number(node.right):
                return ast.BinOp(self.named(node.left), node.op, node.right)
        if isinstance(node, ast.UnaryOp):
            return ast.UnaryOp(node.op, self.named(node.operand))
        if _is_number(node):
            return node
        if isinstance(node, ast.Name):
            self.names[node.id] = node.id
            return node
        label = self._label(node)
        self.names[label] = f"{label}_term"
        self.assignments.append(ast.Assign([ast.Name(f"{label}_term", ast.Store())], node))
        return ast.Name(f"{label}_term", ast.Load())

    def _label(self, node: ast.expr) -> str:
        """After the first thing that an expression names besides modules: a helper or a variable."""
        named = [part.id for part in ast.walk(node) if isinstance(part, ast.Name) and part.id not in ("torch", "math")]
        label, number = named[0], 2
        while label in self.names:
            label, number = f"{named[0]}_{number}", number + 1
        return label


def _is_number(node: ast.expr) -> bool:
    """A literal, or a named constant of the program."""
    return isinstance(node, ast.Constant) or (isinstance(node, ast.Name) and node.id.isupper())


def _call(function: str, *arguments: ast.expr) -> ast.Call:
    called = ast.parse(function, mode="eval").body
    return ast.Call(called, list(arguments), [])
