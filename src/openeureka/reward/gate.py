"""Reads a reward program as text and says, with line and fix, what is not allowed.

The gate is the first filter and never runs anything. It exists for good messages and to make ordinary mistakes cheap.
Against a malicious program, the kernel is the boundary (`sandbox.confine`).
"""

from __future__ import annotations

import ast
import unicodedata
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from types import CodeType

from ..text import printable
from ..types import Finding, StateSpec
from .guess import twin
from .normalise import Draft, Normaliser
from .rules import IMPLICIT, Rules
from .syntax import dotted

FILENAME = "<reward>"
MAX_BYTES = 20_000
MAX_NODES = 4_000
MAX_DEPTH = 100


@dataclass(frozen=True, slots=True)
class Program:
    """A reward program that passed the gate."""

    draft: Draft
    inputs: tuple[str, ...]
    """Every state variable it reads."""
    arguments: tuple[str, ...]
    """The inputs that are arguments of the reward function; others are read as free names or through `self`."""

    @property
    def return_line(self) -> int | None:
        """Line of the last `return` in the reward function."""
        lines = [node.lineno for node in ast.walk(self.draft.entry) if isinstance(node, ast.Return)]
        return max(lines, default=None)

    def code(self) -> CodeType:
        with warnings.catch_warnings(action="ignore"):
            return compile(self.draft.tree, FILENAME, "exec")


def check(source: str, state: StateSpec) -> Program | tuple[Finding, ...]:
    """The program in plain form, or every reason why it is refused, in the order of its lines."""
    try:
        return _check(source, state)
    except Exception as error:  # a text that makes the gate itself fail is refused like any other
        message = f"the gate cannot read it ({type(error).__name__}: {str(error)[:200]})"
        return (Finding(rule="unreadable", message=printable(message), fix="write it in a plainer way"),)


def _check(source: str, state: StateSpec) -> Program | tuple[Finding, ...]:
    findings = list(_text_findings(source))
    if findings:
        return tuple(findings)
    tree = parse(source)
    if isinstance(tree, Finding):
        return (tree,)
    normaliser = Normaliser({*state.names, *IMPLICIT})
    draft = normaliser.build(tree)
    if draft is None:
        return tuple(normaliser.findings)
    rules = Rules(draft, state)
    rules.run()
    found = {finding: None for finding in (*normaliser.findings, *rules.findings)}
    if found:
        return tuple(sorted(found, key=lambda finding: finding.line or 0))
    program = Program(draft, tuple(rules.inputs), tuple(rules.arguments))
    try:
        program.code()
    except SyntaxError as error:  # such as for `break` outside a loop, which parses
        return (_unreadable(error),)
    return program


def _text_findings(source: str) -> Iterator[Finding]:
    if len(source.encode(errors="surrogatepass")) > MAX_BYTES:
        yield Finding(rule="size", message=f"the program is longer than {MAX_BYTES} bytes", fix="write a shorter one")
        return
    for number, line in enumerate(source.split("\n"), start=1):
        for character in line:
            if unicodedata.category(character) in ("Cc", "Cf", "Cs") and character not in "\t\r":
                message = f"invisible or control character U+{ord(character):04X}"
                yield Finding(rule="characters", message=message, fix="remove it", line=number)
                return


def of_numbers(program: Program, line: int | None) -> tuple[str, str] | None:
    """The first function of numpy or math that a line calls, and its counterpart in torch."""
    for node in ast.walk(program.draft.tree):
        if isinstance(node, ast.Call) and node.lineno == line:
            head, _, rest = (dotted(node.func) or "").partition(".")
            path = ".".join(filter(None, (program.draft.names.get(head), rest)))
            if known := twin(path):
                return ast.unparse(node.func), known
    return None


def parse(source: str) -> ast.Module | Finding:
    """The syntax tree of a program, small enough to be walked by recursion, or the reason why there is none."""
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(source, FILENAME)
    except SyntaxError as error:
        return _unreadable(error)
    except (ValueError, RecursionError, MemoryError):
        return Finding(rule="size", message="it is nested too deeply", fix="split it into several lines")
    # Counted without recursion: the visitors below recurse, and this bounds them.
    count, level = 0, [tree]
    for _ in range(MAX_DEPTH + 1):
        count += len(level)
        if count > MAX_NODES:
            return Finding(rule="size", message="the program is too long", fix="write a shorter one")
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        if not level:
            return tree
    line = next((node.lineno for node in level if isinstance(node, ast.expr)), None)
    return Finding(rule="size", message="an expression is nested too deeply", fix="split it into lines", line=line)


def _unreadable(error: SyntaxError) -> Finding:
    return Finding(rule="syntax", message=f"Python cannot read it: {error.msg:.200}", line=error.lineno)
