"""Damages graphs and replies at random, as a bad disk does and as a forger who knows the format does."""

from __future__ import annotations

import json
from collections.abc import Sequence
from random import Random
from typing import Any

from openeureka.reward import surface

_OPERATIONS = (
    *sorted(surface.ATEN),
    "input",
    "constant",
    "getitem",
    "add_.Tensor",
    "as_strided.default",
    "rand.default",
)
_TEXTS = ("", "pos", "float32", "int64", "bool", "cuda", "../../x", "\x1b[2J", "\ud800", "x" * 5000, "nan", "floor")
_NUMBERS = (
    0, 1, -1, 2, 3, 7, 255, 4096, 65_537, 2**31, 2**63 - 1, 2**63, -(2**63), 10**400, 0.5, -0.0, 1e308, 1e-320, True,
)  # fmt: skip
_SYNTAX = ('"', "[", "]", "{", "}", ",", ":", "1", "-", "null", "\x00", "[" * 3000)
_PIECES = (
    "```", "```python\n", "~~~", "def compute_reward(pos):\n", "    return ", "\n\n\n", "\t", "(" * 50, ")" * 9, "[",
    "{'a': ", "lambda: ", "yield ", "await ", "break\n", "nonlocal x\n", "global r\n", "del pos\n", "import os\n",
    "from torch import *\n", "*", "**", ":=", "@", "->", "...", "\\\n", "#", "'''", '"""', "f'{pos}'", "\0", "\ud800",
    "\u202e", "\uff43", "\N{COMBINING ACUTE ACCENT}", "0x", "1e999", "1" * 5000, "x" * 3000, "pos", "torch.", "self.",
    "<think>", "</think>", "if pos:\n", "else:\n", "for i in range(3):\n", "class A:\n", "    ", "\r", "\f",
)  # fmt: skip


def graph(text: str, random: Random) -> str:
    """A graph's JSON with one to three faults, most of them in its nodes. One text in ten is also damaged as text, and
    then it rarely is JSON."""
    data = json.loads(text)
    for _ in range(random.choice((1, 1, 2, 3))):
        if random.random() < 0.9:
            data["nodes"] = _changed(data["nodes"], random)
        else:
            data = _changed(data, random)
        if not (isinstance(data, dict) and data.get("nodes")):
            break
    text = json.dumps(data)
    return _spliced(text, random, _SYNTAX) if random.random() < 0.1 else text


def reply(text: str, random: Random) -> str:
    """A model's reply with one to eight faults."""
    for _ in range(random.randint(1, 8)):
        text = _spliced(text, random, _PIECES)
    return text


def _spliced(text: str, random: Random, pieces: Sequence[str]) -> str:
    """Some characters fewer, some more, or some twice."""
    start = random.randint(0, len(text))
    end = min(len(text), start + random.choice((0, 0, 1, 3, 20, 200)))
    again = text[start:end] if random.random() < 0.2 else ""
    return text[:start] + again + random.choice(pieces) + text[end:]


def _changed(data: Any, random: Random) -> Any:
    """The same data with one place in it changed, most often a deeply nested one."""
    if isinstance(data, list) and data and random.random() < 0.9:
        data = list(data)
        place, action = random.randrange(len(data)), random.random()
        if action < 0.1:
            del data[place]
        elif action < 0.2:
            data.insert(place, data[random.randrange(len(data))])
        else:
            data[place] = _changed(data[place], random)
        return data
    if isinstance(data, dict) and data and random.random() < 0.9:
        # Most nodes have no keyword arguments: look elsewhere.
        filled = [key for key in sorted(data) if data[key] != {} or random.random() < 0.1]
        key = random.choice(filled or sorted(data))
        if random.random() < 0.03:
            return {other: value for other, value in data.items() if other != key}
        return {**data, key: _changed(data[key], random)}
    return _value(data, random)


def _value(data: Any, random: Random) -> Any:
    """Something else, most often of the same kind."""
    if isinstance(data, str) and random.random() < 0.8:
        return random.choice(_OPERATIONS if data in surface.ATEN or random.random() < 0.5 else _TEXTS)
    if isinstance(data, int | float) and random.random() < 0.8:
        return random.choice((data + 1, data - 1, -data, 2 * data, random.choice(_NUMBERS)))
    return random.choice((
        None, [], {}, [[]], random.choice(_NUMBERS), random.choice(_TEXTS), {"ref": random.randint(-1, 9)},
        {"n": random.choice(_NUMBERS)}, {"float": random.choice(("nan", "-inf", "x"))}, [random.choice(_NUMBERS)] * 3,
        {"ref": 0, "n": 1}, [{"ref": random.randint(0, 5)}], [None, {"ref": random.randint(0, 5)}],
    ))  # fmt: skip
