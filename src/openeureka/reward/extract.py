"""Finds the reward program in a reply or a file. Reads text, runs nothing, and takes time linear in the text."""

from __future__ import annotations

import ast
import json
import re
import textwrap
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import TypeAlias

from ..errors import RewardFileError, nearest
from ..types import OWN_REWARDS, Candidate
from .normalise import ENTRY_NAMES

MAX_REPLY = 1_000_000
"""Characters of a reply that are read; the rest is ignored."""
MAX_PARSED = 100_000
"""Characters of the longest block that is parsed; a longer block is not taken for a reward program."""
MAX_TRIMS = 50
MAX_JOINS = 50
"""Further closing fences that are tried in one text, where the first one of a block is inside a string."""
MAX_NESTING = 2

# Possessive quantifiers: a long fence mark that gave characters back would be tried again at every length.
_FENCE = re.compile(
    r"^(?P<quote>[ \t>]*+)(?P<item>(?:(?:[-*+]|\d{1,9}[.)])[ \t]++)?+)(?P<mark>`{3,}+|~{3,}+)(?P<info>[^`\n]*+)$"
)
_QUOTE = re.compile(r"^[ \t]*+(?:> ?)++")
_THOUGHTS = re.compile(r"\A\s*<(think|thinking|thought)>.*?</\1>", re.DOTALL)
_ENDED_THOUGHTS = re.compile(r"\A.*</(?:think|thinking|thought)>", re.DOTALL)
_THINKS = re.compile(r"\s*+<(?:think|thinking|thought)>")
_FUNCTION = re.compile(r"^[ \t]*def[ \t]+(\w+)[ \t]*\(", re.MULTILINE)
_BODY = re.compile(r"^[ \t]++(?:return\b|\w++ *+=(?!=))", re.MULTILINE)
_SKETCHED = re.compile(r"^[ \t]*+(?:# *+)?+(?:\.{3}|…)|\((?:\.{3}|…)\)|^[-+]", re.MULTILINE)
"""Matches an ellipsis that stands for omitted code, or the first character of a line of a diff."""
_CODE_BEGINS = re.compile(r"^(?:import |from \w[\w.]* import |@|def |class )", re.MULTILINE)
_JSON_BEGINS = re.compile(r"\s*+(?=[{\[\"])")
_DOCSTRING = r"[rR]?(?:\"{3}|'{3})"
_FILE_BEGINS = re.compile(
    r"(?:[ \t\r]*+(?:#.*+)?\n)*+"  # blank lines and comments
    rf"(?:{_CODE_BEGINS.pattern}|{_DOCSTRING}|[A-Za-z_]\w*+ *(?:: *\w+ *)?=)",
    re.MULTILINE,
)
_IN_FUNCTION = re.compile(r"[ \t]*(?:def[ \t]+\w+[ \t]*\(|return\b)")
_GOES_ON = re.compile(rf"\s|$|[#)\]}}]|{_DOCSTRING}")
"""Matches the beginning of a line that continues the code above it."""

_Json: TypeAlias = "dict[str, _Json] | list[_Json] | str | float | None"


def program(reply: str) -> str | None:
    """Source of the reward program in a reply, or None where it holds no function.

    The program is the last code block with a reward function, because models draft before they decide. Helper functions
    and constants that it names are added from other blocks. If no code block holds a function, the program is searched
    for between the prose, then in JSON strings. A program with a syntax error is returned too, even if an earlier draft
    has none, so that the model learns which line is wrong.
    """
    text = answer(_plain(reply))
    codes = list(_fenced(text))
    return _among(codes) or _among([_between_prose(text)]) or _among(chain.from_iterable(map(_in_json, [text, *codes])))


def is_settled(reply: str) -> bool:
    """Whether a reply that was cut off still holds a complete program: the program parses, and the cut is neither in
    the thoughts nor in a code block."""
    text = _ENDED_THOUGHTS.sub("", _plain(reply))
    codes = list(_fenced(text))
    if _THINKS.match(text) or codes != list(_fenced(f"{text}\n#")):  # an open block would hold the comment too
        return False
    found = _among(codes)
    return found is not None and _parsed(found) is not None


def fenced(source: str) -> str:
    """A reply with this program in a code block, whose fence is longer than any in the program."""
    longest = max(map(len, re.findall("`+", source)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}python\n{source}\n{fence}"


def answer(text: str) -> str:
    """A reply without its thoughts. Their opening mark may be missing, as some templates end with it. If no function
    follows the last closing mark, only thoughts at the beginning that have both marks are removed."""
    rest = _ENDED_THOUGHTS.sub("", text)
    return rest if _FUNCTION.search(rest) or not _FUNCTION.search(text) else _THOUGHTS.sub("", text)


def in_file(path: Path) -> tuple[Candidate, str]:
    """The program in a file. If the file is a model's whole answer, also a note on how its lines are counted, else an
    empty text. Raises RewardFileError for a file that cannot be read."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        own = f" Where rewards train, {' and '.join(OWN_REWARDS)} are the task's own; here a name is that of a file."
        meant = own if str(path) in OWN_REWARDS else nearest(str(path), OWN_REWARDS)
        raise RewardFileError(f"Cannot read the reward file {path}: {error.strerror}.{meant}") from None
    except UnicodeDecodeError:
        raise RewardFileError(f"{path} is not a text file; a reward file is Python source in UTF-8.") from None
    found = in_text(text)
    prose = f"{path} has text around the program; lines are counted from the program's first."
    return found, prose if found.source != text else ""


def in_text(text: str) -> Candidate:
    """The text as a program, or the program in it if the text is a model's whole answer. A text that begins with code
    but does not parse is kept whole, because the reward may be below the error."""
    text = text.removeprefix("\ufeff")
    found = program(text) if _parsed(text) is None and not _FILE_BEGINS.match(text) else None
    return Candidate.of(found if found is not None else text)


def _plain(reply: str) -> str:
    return reply[:MAX_REPLY].replace("\r\n", "\n").removeprefix("\ufeff")


def _among(codes: Iterable[str]) -> str | None:
    """The program in code blocks."""
    blocks = [_Block.of(code) for code in codes]
    chosen = _choose(blocks)
    if chosen is None:
        return None
    return "\n\n".join([*(helper.source for helper in _helpers(chosen, blocks)), chosen.source])


@dataclass(frozen=True, slots=True)
class _Block:
    source: str
    tree: ast.Module | None
    """None if the source does not parse."""
    defined: frozenset[str]
    """Functions defined anywhere in the block."""
    returns: bool
    """Whether a function has a body that returns; false for a mere signature."""
    meant: frozenset[str]
    """For a block that does not parse: functions it would define. Empty for a mere signature, a sketch or a diff."""

    @property
    def missing(self) -> frozenset[str]:
        """Names that the block reads but never binds, and methods of `self` that it calls but does not define."""
        read, bound, methods = set[str](), set(self.defined), set[str]()
        for node in ast.walk(self.tree) if self.tree is not None else ():
            match node:
                case ast.Name(id=name):
                    (read if isinstance(node.ctx, ast.Load) else bound).add(name)
                case ast.arg(arg=name):
                    bound.add(name)
                case ast.Call(func=ast.Attribute(value=ast.Name(id="self"), attr=name)):
                    methods.add(name)
                case _:
                    pass
        return frozenset((read - bound) | (methods - self.defined))

    @property
    def offered(self) -> frozenset[str]:
        """Names of the block's functions, or of its constants if it holds nothing else."""
        return self.defined or frozenset(_constants(self.tree.body if self.tree is not None else ()))

    @staticmethod
    def of(code: str) -> _Block:
        source = _dedented(code)
        tree = _parsed(source)
        nodes = list(ast.walk(tree)) if tree is not None else []
        functions = frozenset(node.name for node in nodes if isinstance(node, ast.FunctionDef))
        returns = any(isinstance(node, ast.Return) for node in nodes)
        meant = frozenset(_FUNCTION.findall(source)) if tree is None and _is_written_out(source) else frozenset[str]()
        return _Block(source, tree, functions, returns or bool(meant), meant)


def _constants(statements: Iterable[ast.stmt]) -> set[str]:
    """Names that a block assigns, if it only imports and assigns and reads no other names; none for any other block."""
    bound, read = set[str](), set[str]()
    for statement in statements:
        if isinstance(statement, ast.Import | ast.ImportFrom):
            continue
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            return set()
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        bound |= {target.id for target in targets if isinstance(target, ast.Name)}
        read |= {node.id for node in ast.walk(statement.value) if isinstance(node, ast.Name)}
    return bound if read <= bound else set()


def _is_written_out(source: str) -> bool:
    return len(source) <= MAX_PARSED and bool(_BODY.search(source)) and not _SKETCHED.search(source)


def _dedented(code: str) -> str:
    return textwrap.dedent(code.expandtabs(4)).strip() + "\n"


def _choose(blocks: list[_Block]) -> _Block | None:
    """The last reward, if it has one of `ENTRY_NAMES` and does not parse. Else the last block that defines one of these
    names, else a name with `reward` in it, else any function, else a block that looks as if it did. A block that only
    repeats a signature comes after all others."""
    last_first = sorted(reversed(blocks), key=lambda block: not block.returns)
    written = (block for block in last_first if any("reward" in name for name in block.defined | block.meant))
    mistyped = (block for block in islice(written, 1) if not block.meant.isdisjoint(ENTRY_NAMES))
    asked = (block for block in last_first if not block.defined.isdisjoint(ENTRY_NAMES))
    rewards = (block for block in last_first if any("reward" in name for name in block.defined))
    functions = (block for block in last_first if block.defined)
    alike = (block for block in last_first if _FUNCTION.search(block.source))
    return next(chain(mistyped, asked, rewards, functions, alike), None)


def _helpers(chosen: _Block, blocks: list[_Block]) -> list[_Block]:
    """Other blocks that define what the chosen one lacks, directly or through each other, in the order of the reply. A
    block that defines a function of the chosen one is a draft of it and is left out."""
    others = [block for block in blocks if block.defined.isdisjoint(chosen.defined)]
    last = {name: place for place, block in enumerate(others) for name in block.offered}
    found = set[int]()
    missing = list(chosen.missing) if others else []
    while missing:
        place = last.get(missing.pop())
        if place is not None and place not in found:
            found.add(place)
            missing += others[place].missing
    return [others[place] for place in sorted(found)]


def _fenced(text: str, depth: int = 0) -> Iterator[str]:
    """The contents of code blocks."""
    lines = text.split("\n")
    fences = [(place, fence) for place, line in enumerate(lines) if (fence := _FENCE.match(line))]
    joins = iter(range(MAX_JOINS))
    number = 0
    while number < len(fences):
        opening = fences[number][1]
        number, block = _content(lines, fences, number, joins)
        if ">" in opening["quote"]:
            block = [_QUOTE.sub("", line) for line in block]
        yield from _unwrapped(block, depth)
        number += 1


def _content(
    lines: list[str], fences: list[tuple[int, re.Match[str]]], number: int, joins: Iterator[int]
) -> tuple[int, list[str]]:
    """Index of the fence that closes the block which fence `number` opens, and the lines between the two.

    It is the next fence of the same kind that is at least as long, has no text after it and is not at the head of a
    list item. Without one, the block ends with the text. If that fence is inside a string of a program, the one that
    completes the program is taken instead.

    Args:
        fences: each with the index of its line.
        joins: one item is used up for each later fence that is tried.
    """
    place, opening = fences[number]
    ends = (
        later
        for later in range(number + 1, len(fences))
        if not fences[later][1]["info"].strip()
        and not fences[later][1]["item"]
        and fences[later][1]["mark"].startswith(opening["mark"])
    )
    first = next(ends, len(fences))
    block = lines[place + 1 : fences[first][0] if first < len(fences) else None]
    if _in_string(block):
        for _, later in zip(joins, ends, strict=False):
            whole = lines[place + 1 : fences[later][0]]
            if not _in_string(whole) and _is_program("\n".join(whole)):
                return later, whole
    return first, block


def _in_string(lines: list[str]) -> bool:
    """Whether code ends inside a triple-quoted string, judged by the number of quotes."""
    code = "\n".join(lines)
    return any(code.count(quotes) % 2 for quotes in ('"""', "'''"))


def _unwrapped(lines: list[str], depth: int) -> Iterator[str]:
    """The code of a block; for a block of Markdown, the code of the blocks inside it."""
    code = "\n".join(lines)
    if depth == MAX_NESTING or not any(map(_FENCE.match, lines)) or _is_program(code):
        yield code
    else:
        yield from _fenced(code, depth + 1)


def _is_program(code: str) -> bool:
    return _FUNCTION.search(code) is not None and _parsed(_dedented(code)) is not None


def _in_json(text: str) -> Iterator[str]:
    """The code in the strings of JSON, which models write to call a tool or where an endpoint demands JSON. Several
    tool calls are several JSON values in a row."""
    decoder, place = json.JSONDecoder(strict=False), 0
    while begin := _JSON_BEGINS.match(text, place):
        try:
            value, place = decoder.raw_decode(text, begin.end())
        except (ValueError, RecursionError):
            return
        todo: list[_Json] = [value]
        while todo:
            match todo.pop():
                case str(string) if _FUNCTION.search(string):
                    yield from _unwrapped(string.split("\n"), 0)
                case dict(fields):
                    todo += reversed(fields.values())
                case list(items):
                    todo += reversed(items)
                case _:
                    pass


def _between_prose(text: str) -> str:
    """The lines from the first that begins code, without the prose after them: lines that neither parse nor look like
    code."""
    begin = _CODE_BEGINS.search(text)
    if begin is None:
        return ""
    lines = text[begin.start() : begin.start() + MAX_PARSED].split("\n")
    for _ in range(MAX_TRIMS):
        try:
            _parse("\n".join(lines))
        except SyntaxError as error:
            place = _beginning(lines, error.lineno or 1)
            if _CODE_BEGINS.match(lines[place]) or any(map(_IN_FUNCTION.match, lines[place:])):
                break
            lines = lines[:place]
        except (ValueError, RecursionError, MemoryError):
            break
        else:
            break
    return "\n".join(lines)


def _beginning(lines: list[str], number: int) -> int:
    """Index, from 0, of the line that begins the statement which line `number`, from 1, is part of."""
    above = range(min(number, len(lines)) - 1, 0, -1)
    return next((place for place in above if not _GOES_ON.match(lines[place])), 0)


def _parsed(source: str) -> ast.Module | None:
    try:
        return _parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _parse(source: str) -> ast.Module:
    if len(source) > MAX_PARSED:
        raise ValueError("too long for a reward program")
    with warnings.catch_warnings(action="ignore"):  # such as one on an invalid escape in a string
        return ast.parse(source)
