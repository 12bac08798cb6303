"""The part of llama.cpp's grammar notation that this package writes: literals, character classes, rules, {m,n}."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import Literal

_TOKEN = re.compile(
    r"""\s*(?:
        (?P<literal>"(?:[^"\\]|\\.)*")
      | (?P<choice>\[(?:[^\]\\]|\\.)*\])
      | (?P<rule>[a-z][a-z-]*)
      | (?P<bar>\|)
    )(?:\{(?P<least>\d+),(?P<most>\d+)\})?""",
    re.VERBOSE,
)
_RULE = re.compile(r"^([a-z][a-z-]*) ::= (.*)$")


@dataclass(frozen=True, slots=True)
class Item:
    """One symbol, repeated between `least` and `most` times."""

    kind: Literal["literal", "choice", "rule"]
    value: str
    """The text of a literal, the characters of a choice, the name of a rule."""
    least: int = 1
    most: int = 1

    def render(self) -> str:
        bounds = "" if self.least == self.most == 1 else f"{{{self.least},{self.most}}}"
        text = {"literal": json.dumps(self.value), "choice": f"[{self.value}]", "rule": self.value}[self.kind]
        return text + bounds


Sequence = tuple[Item, ...]
Grammar = Mapping[str, tuple[Sequence, ...]]
"""Alternatives of each rule; derivation begins at `root`."""


def literal(text: str) -> Sequence:
    return (Item("literal", text),)


def parse(text: str) -> dict[str, tuple[Sequence, ...]]:
    """Read a grammar of one rule per line. Raises ValueError for notation outside this subset."""
    rules = {}
    for line in text.splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        match = _RULE.match(line)
        if match is None:
            raise ValueError(f"not a grammar rule: {line}")
        rules[match[1]] = _alternatives(match[2])
    return rules


def _alternatives(text: str) -> tuple[Sequence, ...]:
    done: list[Sequence] = []
    items: list[Item] = []
    position = 0
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None:
            raise ValueError(f"not grammar notation: {text[position:]}")
        position = token.end()
        if token["bar"]:
            done.append(tuple(items))
            items = []
        else:
            items.append(_item(token))
    return (*done, tuple(items))


def _item(token: re.Match[str]) -> Item:
    least, most = int(token["least"] or 1), int(token["most"] or 1)
    if token["literal"]:
        return Item("literal", json.loads(token["literal"]), least, most)
    if token["choice"]:
        return Item("choice", token["choice"][1:-1], least, most)
    return Item("rule", token["rule"], least, most)


def render(grammar: Grammar) -> str:
    """The grammar as llama.cpp reads it."""
    return "".join(
        f"{name} ::= {' | '.join(' '.join(item.render() for item in sequence) for sequence in alternatives)}\n"
        for name, alternatives in grammar.items()
    )


def prune(grammar: Grammar) -> dict[str, tuple[Sequence, ...]]:
    """The grammar without alternatives that no string can be derived from, and without rules that nothing uses."""
    kept = dict(grammar)
    while True:
        alive = {
            name: tuple(s for s in alternatives if all(item.kind != "rule" or item.value in kept for item in s))
            for name, alternatives in kept.items()
        }
        alive = {name: alternatives for name, alternatives in alive.items() if alternatives}
        if alive == kept:
            used = _reachable(alive)
            return {name: alternatives for name, alternatives in alive.items() if name in used}
        kept = alive


def _reachable(grammar: Grammar) -> set[str]:
    found: set[str] = set()
    waiting = ["root"] if "root" in grammar else []
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += [item.value for sequence in grammar[name] for item in sequence if item.kind == "rule"]
    return found


def derive(grammar: Grammar, random: Random, rule: str = "root") -> str:
    """A random string of a rule: every alternative and every count is equally likely.

    Repeated characters spell words for a reader. Random ones say nothing, so they are drawn as short as allowed.
    """
    return "".join(_expand(grammar, random, item) for item in random.choice(grammar[rule]))


def _expand(grammar: Grammar, random: Random, item: Item) -> str:
    if item.kind == "choice":
        return "".join(random.choices(_characters(item.value), k=item.least))
    times = range(random.randint(item.least, item.most))
    return "".join(derive(grammar, random, item.value) if item.kind == "rule" else item.value for _ in times)


def _characters(choice: str) -> str:
    """`a-cx` -> `abcx`; a dash at the end stands for itself."""
    ranges = re.findall(r"(.)-(.)|(.)", choice)
    return "".join(single or "".join(map(chr, range(ord(first), ord(last) + 1))) for first, last, single in ranges)
