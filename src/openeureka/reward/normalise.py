"""Brings reward programs, however written, to one plain form: functions and literal constants, nothing else.

Imports become a table of names; decorators, annotations, docstrings, prints, examples of use and `device=` are dropped.
Line numbers stay those of the source. What cannot be brought to that form becomes a finding; `rules` says whether the
rest is allowed.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass
from typing import TypeVar, cast

from ..types import Finding
from . import surface
from .folding import Folder
from .syntax import dotted, stored

ENTRY_NAMES = ("compute_reward", "compute_gpt_reward", "_get_rewards_eureka", "_get_rewards")
DROPPED_DECORATORS = frozenset({
    "torch.jit.script", "torch.jit.script_if_tracing", "torch.jit.export", "torch.jit.ignore", "torch.jit.unused",
    "torch.compile", "torch.no_grad", "torch.inference_mode", "staticmethod", "script", "jit.script",
})  # fmt: skip
IGNORED_PACKAGES = frozenset({"typing", "typing_extensions", "__future__", "isaacgym", "isaacgymenvs", "collections"})
"""Their names are annotations, or helpers that are present without an import."""
SHORT_NAMES = {"torch": "torch", "math": "math", "np": "numpy", "F": "torch.nn.functional", "nn": "torch.nn"}
"""Bound in every program, imported or not."""
ACTORS, ROWS = "root_state_tensor", "_indices"
"""Isaac Gym's tensor whose rows are the actors of all worlds, and how names end that pick one actor of each world."""
_ANNOTATION_NODES = (
    ast.Name, ast.Attribute, ast.Subscript, ast.Tuple, ast.List, ast.Constant, ast.BinOp, ast.BitOr, ast.Load,
)  # fmt: skip

DEVICES = ("torch.cuda", "torch.backends", "torch.device")
LEAVE_OUT = "leave it out: a reward runs where its inputs are"
"""The advice on code that chooses a device."""
_PATHS = frozenset({*surface.MODULES, *surface.PACKAGES, *DROPPED_DECORATORS})
"""Modules, packages and decorators that may be imported as such."""
_EXAMPLES = (ast.Expr, ast.Assign, ast.AnnAssign, ast.Assert, ast.If, ast.For, ast.While, ast.With, ast.Try)
"""Statements that an example of use is made of."""

_Function = TypeVar("_Function", ast.FunctionDef, ast.Lambda)


@dataclass(frozen=True, slots=True)
class Draft:
    """A program in plain form, not yet checked."""

    tree: ast.Module
    entry: ast.FunctionDef
    functions: Mapping[str, ast.FunctionDef]
    names: Mapping[str, str]
    """Name to dotted path, for everything imported and the short names every program has."""
    constants: frozenset[str]
    """Names of module-level literals."""
    ignored: Mapping[str, str]
    """Name to dotted path, for imports that are accepted but give nothing."""
    refused: frozenset[str]
    """Names that a finding is about already: their use is no further finding."""

    @property
    def method(self) -> bool:
        """Whether the reward reads the state as attributes of `self`."""
        return bool(self.entry.args.args) and self.entry.args.args[0].arg == "self"


def entry_name(functions: Iterable[str]) -> str:
    """Which of a program's functions is the reward: the first of `ENTRY_NAMES` that it has, else its last function.

    Args:
        functions: one or more names, in the order of the program.
    """
    names = list(functions)
    return next((name for name in ENTRY_NAMES if name in names), names[-1])


def _is_literal(node: ast.expr) -> bool:
    try:
        ast.literal_eval(node)
    except (ValueError, TypeError):
        return False
    return True


def _own_functions(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.Assign(targets=[ast.Name(id=name)], value=ast.Lambda()):
                yield name
            case _:
                pass


def _named(target: ast.expr, value: ast.expr) -> dict[str, ast.expr] | None:
    """The values assigned to `A` or `A, B`, by name; None for other targets, or if the numbers of both differ."""
    match target, value:
        case ast.Name(id=name), _:
            return {name: value}
        case ast.Tuple(elts=names), ast.Tuple(elts=own) | ast.List(elts=own) if len(names) == len(own):
            pairs = zip(names, own, strict=True)
            named = {name.id: part for name, part in pairs if isinstance(name, ast.Name)}
            return named if len(named) == len(names) else None
        case _:
            return None


class Normaliser(ast.NodeTransformer):
    """Builds a `Draft`; if it cannot, `findings` says why.

    Args:
        inputs: names that are read from the state, even if an example of use assigns to them.
    """

    def __init__(self, inputs: Set[str]) -> None:
        self._inputs = inputs
        self._refused: set[str] = set()
        self.findings: list[Finding] = []
        self.names = dict(SHORT_NAMES)
        self.functions: dict[str, ast.FunctionDef] = {}
        self.constants: dict[str, ast.expr] = {}
        self.ignored: dict[str, str] = {}
        self._own: set[str] = set()
        """Names of functions that the program defines, at any depth."""
        self._offered: set[str] = set(surface.ALL_HELPERS)
        """Names of functions that are there without an import, and those that variables give to torch's."""
        self._static: set[str] = set()

    def build(self, tree: ast.Module) -> Draft | None:
        self.functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        self._own = set(_own_functions(tree))
        self._static = {
            name
            for name, function in self.functions.items()
            if any(dotted(decorator) == "staticmethod" for decorator in function.decorator_list)
        }
        if not self.functions:
            for node in tree.body:
                if isinstance(node, ast.ClassDef):
                    self._refuse_class(node)
            if not self.findings:
                self._refuse("no-function", "the program defines no function", tree, "define `def compute_reward(...)`")
            return None
        last = max(node.lineno for node in self.functions.values())
        kept = (self._top_level(statement, after=statement.lineno > last) for statement in tree.body)
        body = [statement for statement in kept if statement is not None]
        entry = self.functions[entry_name(self.functions)]
        plain = ast.fix_missing_locations(ast.Module(body=body, type_ignores=[]))
        return Draft(
            tree=plain,
            entry=entry,
            functions=self.functions,
            names=self.names,
            constants=frozenset(self.constants),
            ignored=self.ignored,
            refused=frozenset(self._refused),
        )

    def _refuse(self, rule: str, message: str, node: ast.AST, fix: str = "") -> None:
        self.findings.append(Finding(rule=rule, message=message[:300], fix=fix, line=getattr(node, "lineno", None)))

    def _refuse_class(self, node: ast.ClassDef) -> None:
        self._refused.add(node.name)
        self._refuse("statement", "`class` is not allowed", node, "write plain functions")

    # --- module level ---

    def _top_level(self, node: ast.stmt, *, after: bool) -> ast.stmt | None:
        if isinstance(node, ast.Import | ast.ImportFrom):
            self._import(node)
            return None
        if isinstance(node, ast.FunctionDef):
            self._fold_defaults(node)
            return self.visit(node)
        if isinstance(node, ast.ClassDef):
            self._refuse_class(node)
            return None
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return None
        if isinstance(node, ast.AnnAssign | ast.Assign) and not (after and stored(node) & self._inputs):
            plain = self.visit(node)
            if isinstance(plain, ast.Assign) and self._literal_assignment(plain):
                return plain
        if after and isinstance(node, _EXAMPLES):
            return None  # below the last function: an example of use
        self._refused |= stored(node)
        chooses = any((self._path(part) or "").startswith(DEVICES) for part in ast.walk(node))
        message = "only imports, functions and literal constants may stand outside a function"
        fix = LEAVE_OUT if chooses else "move it into the reward function or remove it"
        self._refuse("statement", message, node, fix)
        return None

    def _literal_assignment(self, node: ast.Assign) -> bool:
        node.value = self._folded(node.value)
        if not _is_literal(node.value):
            return False
        bound: dict[str, ast.expr] = {}
        for target in node.targets:
            named = _named(target, node.value)
            if named is None:
                return False
            bound |= named
        self.constants |= bound
        return True

    def _folded(self, node: ast.expr) -> ast.expr:
        return Folder(self.names, self.constants).visit(node)

    def _fold_defaults(self, node: ast.FunctionDef) -> None:
        """For functions at module level only: inside a function, a name may be a local variable."""
        arguments = node.args
        arguments.defaults = [self._folded(default) for default in arguments.defaults]
        arguments.kw_defaults = [default and self._folded(default) for default in arguments.kw_defaults]
        for default in (*arguments.defaults, *arguments.kw_defaults):
            if default is not None and not _is_literal(default):
                self._refuse("signature", "a default must be a literal number", node, "write the number itself")

    def _import(self, node: ast.Import | ast.ImportFrom) -> None:
        """Bind the names of an import, and refuse the paths that are not offered."""
        for alias in node.names:
            if isinstance(node, ast.Import):
                path, bound = alias.name, alias.asname or alias.name.split(".")[0]
                target = path if alias.asname else bound
            else:
                path, bound = f"{node.module or ''}.{alias.name}", alias.asname or alias.name
                target = path
            parent, _, name = path.rpartition(".")
            if path in surface.HELPER_MODULES:
                target = target if target in ("isaacgym", "isaacgymenvs") else surface.HELPERS_PATH
            elif parent in surface.HELPER_MODULES and name in surface.ALL_HELPERS:
                target = f"{surface.HELPERS_PATH}.{name}"
            elif path.split(".")[0] in IGNORED_PACKAGES or parent in surface.HELPER_MODULES:
                self.ignored[bound] = target
                continue
            elif path not in _PATHS and name not in surface.MODULES.get(parent, ()):
                fix = "torch, math, typing and `np.pi` are there; helpers such as `quat_mul` need no import"
                self._refused.add(bound)
                self._refuse("import", f"`{path}` cannot be imported", node, fix)
                continue
            if bound.startswith("__"):
                self._refuse("dunder", f"`{bound[:40]}` is not allowed", node, "choose another name")
                continue
            self.names[bound] = target

    # --- inside functions ---

    def _visit_import(self, node: ast.Import | ast.ImportFrom) -> ast.stmt:
        self._import(node)
        return ast.copy_location(ast.Pass(), node)

    visit_Import = visit_ImportFrom = _visit_import

    def visit_Delete(self, node: ast.Delete) -> ast.stmt:
        names = all(isinstance(target, ast.Name) for target in node.targets)
        return ast.copy_location(ast.Pass(), node) if names else node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        for decorator in node.decorator_list:
            plain = decorator.func if isinstance(decorator, ast.Call) and not decorator.args else decorator
            if not self._drops(plain):
                self._refuse("decorator", "this decorator is not allowed", decorator, "remove it")
        node.decorator_list = []
        if node.returns is not None:
            self._annotation(node.returns)
            node.returns = None
        if isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant):
            node.body = node.body[1:] or [ast.copy_location(ast.Pass(), node.body[0])]
        return self._function(node)

    def _function(self, node: _Function) -> _Function:
        arguments = node.args
        others = (*arguments.posonlyargs, arguments.vararg, arguments.kwarg)
        if unnamed := {argument.arg for argument in others if argument is not None}:
            self._refused |= unnamed
            self._refuse("signature", "`*`, `**` and `/` are not allowed in a signature", node, "name every argument")
        for argument in (*arguments.args, *arguments.kwonlyargs):
            if argument.annotation is not None:
                self._annotation(argument.annotation)
                argument.annotation = None
        self.generic_visit(node)
        return node

    visit_Lambda = _function

    def _drops(self, decorator: ast.AST) -> bool:
        return (self._path(decorator) or dotted(decorator)) in DROPPED_DECORATORS

    def _path(self, node: ast.AST) -> str | None:
        """The dotted path of a name, through the imports."""
        root, dot, rest = (dotted(node) or "").partition(".")
        known = self.names.get(root) or self.ignored.get(root)
        return f"{known}{dot}{rest}" if known else None

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt:
        self._annotation(node.annotation)
        if node.value is None:
            return ast.copy_location(ast.Pass(), node)
        plain = ast.Assign(targets=[node.target], value=node.value)
        self.generic_visit(plain)
        return ast.copy_location(plain, node)

    def _annotation(self, node: ast.expr) -> None:
        if not all(isinstance(part, _ANNOTATION_NODES) for part in ast.walk(node)):
            self._refuse("annotation", "an annotation may only name types", node, "remove the annotation")

    def visit_Assign(self, node: ast.Assign) -> ast.Assign:
        self.generic_visit(node)
        named = [pair for target in node.targets for pair in (_named(target, node.value) or {}).items()]
        self._offered |= {name for name, value in named if (self._path(value) or "").startswith("torch.")}
        return node

    def visit_Expr(self, node: ast.Expr) -> ast.stmt:
        value = node.value
        printed = isinstance(value, ast.Call) and dotted(value.func) == "print"
        if printed or isinstance(value, ast.Constant):
            return ast.copy_location(ast.Pass(), node)
        self.generic_visit(node)
        return node

    def visit_With(self, node: ast.With) -> ast.stmt | list[ast.stmt]:
        for item in node.items:
            call = item.context_expr
            if not (isinstance(call, ast.Call) and not call.args and self._drops(call.func)):
                return node
        body: list[ast.stmt] = []
        for statement in node.body:
            kept = self.visit(statement)
            body.extend(cast(list[ast.stmt], kept) if isinstance(kept, list) else [kept])
        return body

    def visit_Subscript(self, node: ast.Subscript) -> ast.Subscript:
        self.generic_visit(node)
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if not parts:  # `x[()]`
            return node
        first, *rest = parts
        if isinstance(first, ast.Call) and isinstance(first.func, ast.Attribute) and first.func.attr in ("long", "to"):
            first = first.func.value
        picked = (dotted(first) or "").endswith(ROWS)
        if picked and (dotted(node.value) or "").rpartition(".")[2] == ACTORS:
            # Here the worlds have their own axis, before that of the actors.
            worlds = ast.copy_location(ast.Slice(), first)
            node.slice = ast.copy_location(ast.Tuple([worlds, first, *rest], ast.Load()), node.slice)
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        name = self._path(node.func)
        if name in ("torch.jit.annotate", "typing.cast") and len(node.args) == 2:
            self._annotation(node.args[0])
            return node.args[1]
        if name in ("torch.jit.is_scripting", "torch.jit.is_tracing"):
            return ast.copy_location(ast.Constant(name == "torch.jit.is_scripting"), node)
        match node.func:
            case ast.Attribute(value=ast.Name(id="self") as owner, attr=called) if called in self.functions:
                node.func = ast.copy_location(ast.Name(called, ast.Load()), node.func)
                if called not in self._static:
                    node.args.insert(0, owner)
                return node
            case ast.Attribute(attr="update"):  # of a dict: the keywords are keys
                return node
            case ast.Attribute():
                return self._without_device(node)
            case ast.Name(id=called) if called in self._own:
                return node
            case ast.Name(id=called) if called in self.names or called in self._offered:
                return self._without_device(node)
            case _:
                return node

    def _without_device(self, node: ast.Call) -> ast.expr:
        """The call without the device that its author names, which means nothing: a graph runs where its inputs are."""
        node.keywords = [word for word in node.keywords if word.arg not in ("device", "requires_grad")]
        if isinstance(node.func, ast.Attribute):
            if node.func.attr == "to" and node.args and isinstance(node.args[0], ast.Constant):
                del node.args[0]
                if not node.args and not any(word.arg == "dtype" for word in node.keywords):
                    return node.func.value
            if node.func.attr == "cuda":
                return node.func.value
        return node
