"""The form of a reward, independent of the order of its terms: a race treats programs of one form as one reward."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import cast

from ..types import PROGRESS, Arg, Node, Part, RewardGraph

Terms = dict[str, float]
"""A value as a weighted sum: the weight of each term, by the digest of the term."""

_EITHER_WAY = frozenset({"mul.Tensor", "maximum.default", "minimum.default"})
"""Operations other than sums for which the order of the two arguments does not matter."""
_ZERO = "0"
_DIGITS = 9
"""Significant digits of a weight that are compared, so that 1 / 0.1 equals 10."""


def form(graph: RewardGraph) -> str:
    """A digest that is equal for rewards that pay the same up to rounding and differ in names and order of their terms.

    Only sums, differences and weights are normalised. Other equal expressions, such as x * x and x ** 2, differ.
    """
    done: list[Terms] = []

    @cache  # many nodes may refer to one long sum
    def digest(index: int) -> str:
        return _digest(done[index])

    for node in graph.nodes:
        done.append(_terms(node, done, digest))
    progress = [digest(index) for name, index in graph.components if name.startswith(PROGRESS)]
    reward = _digest({name: weight for name, weight in done[graph.reward].items() if name != _ZERO})
    return _short([reward, *progress]) if progress else reward  # bonus=progress pays for these even outside the total


def _terms(node: Node, done: Sequence[Terms], digest: Callable[[int], str]) -> Terms:
    """A node's value, from those before it and their digests."""
    name = node.op.partition(".")[0]
    if name == "zeros_like":
        return {_ZERO: 1.0}  # kept as an argument of other operations, where its shape may matter
    # A graph may be forged: a node whose arguments are not placed and named as by tracing is not read as a sum.
    if name == "neg" and node.args:
        return _sum({}, _sides(node, done)[0], -1)
    if name in ("add", "sub", "rsub") and len(node.args) == 2 and node.kwargs.keys() <= {"alpha"}:
        alpha = node.kwargs.get("alpha", 1)
        if isinstance(alpha, int | float):
            own, other = _sides(node, done)
            if name == "rsub":  # as `1 - x` is traced
                own, other = other, own
            return _sum(own, other, alpha if name == "add" else -alpha)
    if name in ("mul", "div") and not node.kwargs:
        weight = node.args[1]
        if isinstance(weight, int | float) and weight:
            return _sum({}, _sides(node, done)[0], weight if name == "mul" else 1 / weight)
    args = [_spelled(arg, digest) for arg in node.args]
    if node.op in _EITHER_WAY:
        args.sort()
    named = sorted((key, _spelled(arg, digest)) for key, arg in node.kwargs.items())
    return {_short((node.op, args, named)): 1.0}


def _sides(node: Node, done: Sequence[Terms]) -> list[Terms]:
    """The arguments of a sum, each as a weighted sum itself."""

    def side(arg: Arg) -> Terms:
        if not isinstance(arg, Mapping):
            return {"1": float(cast(float, arg))}
        return done[arg["ref"]] if "ref" in arg else {"worlds": float(arg["n"])}

    return [side(arg) for arg in node.args]


def _sum(own: Terms, other: Terms, weight: float) -> Terms:
    names = dict.fromkeys((*own, *other))
    total = {name: own.get(name, 0.0) + weight * other.get(name, 0.0) for name in names}
    return {name: value for name, value in total.items() if value}


def _spelled(arg: Arg, digest: Callable[[int], str]) -> str:
    def part(value: Part) -> str:
        return digest(value["ref"]) if isinstance(value, Mapping) and "ref" in value else repr(value)

    return repr([part(value) for value in arg]) if isinstance(arg, tuple) else part(arg)


def _digest(terms: Terms) -> str:
    return _short(sorted((name, f"{value:.{_DIGITS}g}") for name, value in terms.items()))


def _short(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:32]
