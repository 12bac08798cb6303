"""Which syntax and names a reward program may use: one walk over its plain form, against the lists of `surface`."""

from __future__ import annotations

import ast
from collections.abc import Iterable

from ..types import Finding, StateSpec
from . import guess, surface
from .folding import MAX_INT
from .normalise import DEVICES, LEAVE_OUT, Draft
from .syntax import Scope, bound, defaults, dotted, identifiers, rebound, shown

MAX_RANGE = 1_000
MAX_GUESSED = 40
"""Letters of the longest name for which a guess is made."""
MAX_GUESSES = 20
"""Guesses made for one program."""
MAX_KNOWN = 100
"""Names of the program itself that a guess may offer."""
IMPLICIT = ("num_envs", "device")
"""Readable in every task, whether or not its table lists them."""

_STATEMENTS = (
    ast.Module, ast.FunctionDef, ast.Return, ast.Assign, ast.AugAssign, ast.Expr, ast.If, ast.For, ast.Pass, ast.Break,
    ast.Continue, ast.Assert, ast.Raise, ast.arguments, ast.arg, ast.keyword, ast.comprehension,
)  # fmt: skip
_EXPRESSIONS = (
    ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Call, ast.Attribute, ast.Name, ast.Constant,
    ast.Subscript, ast.Slice, ast.Tuple, ast.List, ast.Dict, ast.ListComp, ast.DictComp, ast.GeneratorExp, ast.Lambda,
    ast.Starred, ast.JoinedStr, ast.FormattedValue,
    ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.expr_context,
)  # fmt: skip
_ASYNC = "`async`", "remove the word"
_TRY = "`try`", "remove it: an error in a reward is reported with its line"
_YIELD = "`yield`", "return a list"
_TYPE_PARAMETER = "a type parameter such as `[T]`", "remove it"
_FORMS = {
    "AsyncFor": _ASYNC,
    "AsyncFunctionDef": _ASYNC,
    "AsyncWith": _ASYNC,
    "Await": ("`await`", "remove the word"),
    "ClassDef": ("`class`", "write plain functions"),
    "Delete": ("`del` of a part", "leave it there"),
    "Global": ("`global`", "pass the value as an argument"),
    "Match": ("`match`", "use torch.where"),
    "NamedExpr": ("`:=`", "assign on a line of its own"),
    "Nonlocal": ("`nonlocal`", "pass the value as an argument, and return the new one"),
    "ParamSpec": _TYPE_PARAMETER,
    "Set": ("a set", "write a list or a tuple"),
    "SetComp": ("a set", "write a list"),
    "TemplateStr": ("a t-string", "use an f-string"),
    "Try": _TRY,
    "TryStar": _TRY,
    "TypeAlias": ("`type`", "remove the line"),
    "TypeVar": _TYPE_PARAMETER,
    "TypeVarTuple": _TYPE_PARAMETER,
    "While": ("`while`", "use tensor operations, or `for` over a small `range`"),
    "With": ("`with`", "keep its body, remove the line"),
    "Yield": _YIELD,
    "YieldFrom": _YIELD,
}
"""What an author calls a refused node, and what to write instead. By name: Python 3.11 lacks some of them."""
_OTHERWISE = "write it with other operations"
_EARLIER = "values of earlier steps are not available"
_INSTEAD = {
    "data": "leave it out, the tensor itself is what it gives",
    "format": "use an f-string",
    "requires_grad_": "leave it out: nothing differentiates a reward",
}
_CHANGES = frozenset(("append", "clear", "extend", "insert", "pop", "popitem", "remove", "setdefault", "update"))
"""Methods that change a list or a dict."""
_COPY = "copy it first: `{name} = {name}.clone()`"
_AUGMENTED: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**",
    ast.MatMult: "@", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.LShift: "<<", ast.RShift: ">>",
}  # fmt: skip


class Rules(ast.NodeVisitor):
    """Walks a draft against the allow-lists and collects the inputs on the way."""

    def __init__(self, draft: Draft, state: StateSpec) -> None:
        self.draft, self.state = draft, state
        self.findings: list[Finding] = []
        self.inputs: dict[str, None] = {}
        self.arguments: dict[str, None] = {}
        self._locals: frozenset[str] = frozenset()
        """Names bound in the function that is being visited and in the functions around it."""
        self._protected: frozenset[str] = frozenset()
        self._remembered: frozenset[str] = frozenset()
        """Arguments whose default is a list or a dict, which all calls share."""
        self._guesses = MAX_GUESSES

    def run(self) -> None:
        self._signature()
        for statement in self.draft.tree.body:
            if isinstance(statement, ast.FunctionDef):
                is_entry = statement is self.draft.entry
                self._protected = frozenset(self.arguments) - rebound(statement) if is_entry else frozenset()
            self.visit(statement)

    def _refuse(self, rule: str, message: str, node: ast.AST, fix: str = "") -> None:
        # An identifier may be as long as the program.
        self.findings.append(Finding(rule=rule, message=message[:300], fix=fix, line=getattr(node, "lineno", None)))

    def _guess(self, name: str, known: Iterable[str], likeness: float = guess.MISSPELT) -> str:
        """`did you mean X?`, or an empty text.

        Guesses are limited: each takes a millisecond or more, and a program may hold thousands of long unknown names.
        """
        if len(name) > MAX_GUESSED or self._guesses == 0:
            return ""
        self._guesses -= 1
        match = guess.misspelt(name, known, likeness)
        return f"did you mean `{match}`?" if match else ""

    def _is_input(self, name: str) -> bool:
        return name in self.state or name in IMPLICIT

    def _unknown_input(self, name: str, node: ast.AST) -> None:
        inputs = f"inputs are {', '.join(self.state.names)}"
        if said := self._guess(name, self.state.names, guess.RENAMED):
            fix = f"{said} {inputs}"
        else:
            fix = f"{_EARLIER}; the {inputs}" if guess.is_earlier(name) else f"the {inputs}"
        self._refuse("unknown-input", f"`{name}` is not a state variable of this task", node, fix)

    def _signature(self) -> None:
        arguments = self.draft.entry.args
        positional = arguments.args[1:] if self.draft.method else arguments.args
        defaulted = {argument.arg for argument, _ in defaults(self.draft.entry)}
        for argument in (*positional, *arguments.kwonlyargs):
            if self._is_input(argument.arg):
                self.inputs[argument.arg] = self.arguments[argument.arg] = None
            elif argument.arg not in defaulted:
                self._unknown_input(argument.arg, argument)

    # --- nodes ---

    def visit(self, node: ast.AST) -> None:
        if not isinstance(node, (*_STATEMENTS, *_EXPRESSIONS)):
            name = type(node).__name__
            called, fix = _FORMS.get(name, (f"`{name}`", "remove it"))
            self._refuse("statement", f"{called} is not allowed", node, fix)
            return
        for name in identifiers(node):
            if not name.isascii():
                self._refuse("characters", "identifiers must be plain ASCII", node, "rename it")
            elif name.startswith("__"):
                self._refuse("dunder", f"`{name[:40]}` is not allowed", node, "remove it")
        super().visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, bytes | complex):
            self._refuse("literal", "bytes and complex numbers are not allowed", node, "use a float")
        elif isinstance(node.value, int) and abs(node.value) > MAX_INT:
            self._refuse("literal", "an integer of more than 64 bits", node, "use a float")

    def visit_FormattedValue(self, node: ast.FormattedValue) -> None:
        if node.format_spec is not None or node.conversion != -1:
            self._refuse("f-string", "a format in an f-string is not allowed", node, "write `{name}` alone")
        self.visit(node.value)

    def visit_Name(self, node: ast.Name) -> None:
        name = node.id
        if isinstance(node.ctx, ast.Store | ast.Del):
            if name in ("torch", "math", "self"):
                self._refuse("shadowing", f"`{name}` may not be assigned", node, "choose another name")
            return
        draft = self.draft
        if name in self._locals or name in draft.functions or name in draft.constants or name in draft.refused:
            return
        if name in draft.names:
            self._imported(draft.names[name], node)
        elif name in surface.ALL_HELPERS or name in surface.BUILTINS:
            return
        elif self._is_input(name):
            self.inputs[name] = None
        elif name in surface.RANDOM:
            self._random(name, node)
        elif name in draft.ignored:
            message = f"`{draft.ignored[name]}` is not available to a reward"
            self._refuse("unknown-name", message, node, "use it in annotations alone, and write `{}` for a dict")
        else:
            local = sorted(self._locals, key=len)[:MAX_KNOWN]
            fix = self._guess(name, (*self.state.names, *local), guess.RENAMED)
            if not fix and (known := guess.instead(name)):
                fix = f"use `{known}`"
            fix = fix or self._guess(name, (*surface.ALL_HELPERS, *surface.BUILTINS))
            fix = fix or (_EARLIER if guess.is_earlier(name) else "define it or remove it")
            self._refuse("unknown-name", f"`{name}` is not defined", node, fix)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if not isinstance(node.ctx, ast.Load):
            rule = "input-edit" if _is_of_self(node) else "attribute"
            self._refuse(rule, f"`{shown(node)}` may not be assigned", node, "use a local variable and return it")
            return
        path = dotted(node)
        root = path.split(".")[0] if path else ""
        if root in self.draft.refused and root not in self._locals:
            return
        if path and root not in self._locals and root in self.draft.names:
            self._imported(f"{self.draft.names[root]}{path[len(root) :]}", node)
            return
        if not _is_of_self(node):
            self.visit(node.value)
            self._method(node)
        elif self._is_input(node.attr):
            self.inputs[node.attr] = None
        else:
            self._unknown_input(node.attr, node)

    def _method(self, node: ast.Attribute) -> None:
        name = node.attr
        if name in surface.RANDOM:
            self._random(name, node)
        elif name in surface.READS:
            message = f"`.{name}` turns tensor values into Python values"
            self._refuse("data-read", message, node, "stay with tensors of one value per world")
        elif name not in surface.METHODS and name not in surface.IN_PLACE_METHODS:
            known = guess.instead(name)
            function = f"use `{known}`" if known else ""
            if name in surface.DTYPES:
                function = f"write `.to(torch.{name})`"
            fix = _INSTEAD.get(name) or function or self._guess(name, surface.METHODS) or _OTHERWISE
            self._refuse("attribute", f"`.{name[:40]}` is not an allowed attribute", node, fix)

    def _imported(self, path: str, node: ast.AST) -> None:
        """An imported name or a chain that starts at one: `torch.exp`, `F.softplus`, `torch.pi.x`."""
        parts = path.split(".")
        for end in range(len(parts), 1, -1):
            module, name = ".".join(parts[: end - 1]), parts[end - 1]
            if name in surface.MODULES.get(module, ()):
                for attribute in parts[end:]:
                    if attribute not in surface.METHODS:
                        self._refuse("attribute", f"`.{attribute[:40]}` is not an allowed attribute", node, _OTHERWISE)
                return
        name = parts[-1]
        if path in surface.MODULES or path in surface.PACKAGES:
            self._refuse("module-value", f"`{path}` cannot be used as a value", node, "call one of its functions")
        elif name in surface.RANDOM:
            self._random(path, node)
        elif name in surface.READS:
            message = f"`{path}` returns values whose number depends on the data"
            self._refuse("data-read", message, node, "use torch.where or a mask")
        else:
            offered = surface.MODULES.get(path.rpartition(".")[0], surface.TORCH)
            known = guess.twin(path) or guess.instead(name)
            fix = f"use `{known}`" if known else self._guess(name, offered) or "write it with tensor operations"
            if not known and path.startswith(DEVICES):
                fix = LEAVE_OUT
            elif path == "math.prod":
                fix = "multiply the numbers with `*`"
            elif path == f"numpy.{name}" and name in surface.DTYPES:
                fix = f"write the number itself, or `{known}` for a dtype"
            self._refuse("torch-function", f"`{path[:60]}` is not available to a reward", node, fix)

    def _random(self, name: str, node: ast.AST) -> None:
        message = f"`{name}` is random, and a reward must give the same value for the same state"
        self._refuse("randomness", message, node, "remove it")

    # --- scopes ---

    def _visit_scope(self, node: Scope) -> None:
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            for default in filter(None, (*node.args.defaults, *node.args.kw_defaults)):
                self.visit(default)  # in `i=i`, the default is the outer `i`
        outer = self._locals, self._remembered
        self._locals, self._remembered = self._locals | bound(node), self._remembered - bound(node) | _mutable(node)
        self.generic_visit(node)
        self._locals, self._remembered = outer

    def visit_arguments(self, node: ast.arguments) -> None:
        for argument in (*node.args, *node.kwonlyargs):
            self.visit(argument)

    visit_FunctionDef = visit_Lambda = _visit_scope
    visit_ListComp = visit_DictComp = visit_GeneratorExp = _visit_scope

    # --- calls and assignments ---

    def visit_Call(self, node: ast.Call) -> None:
        for keyword in node.keywords:
            unused = isinstance(keyword.value, ast.Constant) and not keyword.value.value
            if keyword.arg in ("out", "inplace") and not unused:
                message = f"`{keyword.arg}=` writes into an existing tensor"
                self._refuse("input-edit", message, node, "use the returned value")
            elif keyword.arg is None:
                self._refuse("statement", "`**` in a call is not allowed", node, "name the arguments")
        match node.func:
            case ast.Name(id="range") if any(map(_is_huge, node.args)):
                self._refuse("loop-size", f"a loop of more than {MAX_RANGE} turns", node, "use tensor operations")
            case ast.Attribute(value=changed, attr=called) if called in _CHANGES:
                self._expect_no_memory(changed, node)
            case ast.Attribute(value=changed, attr=called) if called in surface.IN_PLACE_METHODS:
                if name := self._protected_root(changed):
                    pure = called[:-1]
                    fix = f"use `.{pure}` and keep the result" if pure in surface.METHODS else _COPY.format(name=name)
                    self._refuse("input-edit", f"in-place `.{called}` on input `{name}`", node, fix)
            case _:
                pass
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Subscript):
            self._expect_no_memory(node.target, node)
        if name := self._protected_root(node.target):
            sign = _AUGMENTED[type(node.op)]
            if isinstance(node.target, ast.Name):
                fix = f"write `{name} = {name} {sign} {shown(node.value)}`"
            else:
                fix = _COPY.format(name=name)
            self._refuse("input-edit", f"in-place `{sign}=` on input `{name}`", node, fix)
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            if not isinstance(target, ast.Subscript):
                continue
            self._expect_no_memory(target, node)
            if name := self._protected_root(target):
                self._refuse("input-edit", f"assignment into input `{name}`", node, _COPY.format(name=name))
        self.generic_visit(node)

    def _expect_no_memory(self, changed: ast.AST, node: ast.AST) -> None:
        """Refuse to change a value that outlives a call: a graph would keep the value of one call for ever."""
        whole = _whole(changed)
        name = whole.id if isinstance(whole, ast.Name) else ""
        if name in self._remembered or (name in self.draft.constants and name not in self._locals):
            message = f"`{name}` would keep a value from one call to the next"
            self._refuse("state", message, node, "compute the reward from the state variables alone")

    def _protected_root(self, node: ast.AST) -> str | None:
        """The input tensor that `x`, `x[...]` or `self.x[...]` names."""
        match _whole(node):
            case ast.Attribute(value=ast.Name(id="self"), attr=name) if name in self.state:
                return f"self.{name}"
            case ast.Name(id=name) if name in self._protected and name in self.state:
                return name if self.state[name].kind in ("world", "constant") else None
            case _:
                return None


def _whole(node: ast.AST) -> ast.AST:
    """An expression without its subscripts: `x` for each of `x`, `x[...]` and `x[...][...]`."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return node


def _is_of_self(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id == "self"


def _is_huge(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int) and node.value > MAX_RANGE


def _mutable(node: Scope) -> frozenset[str]:
    """Arguments of a function whose default is a list or a dict."""
    if not isinstance(node, ast.FunctionDef | ast.Lambda):
        return frozenset()
    return frozenset(arg.arg for arg, default in defaults(node) if isinstance(default, ast.List | ast.Dict))
