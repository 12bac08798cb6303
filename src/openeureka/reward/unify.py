"""One graph for any number of worlds, from several traces of a program.

A trace holds for the worlds it was made with. What differs between traces is a multiple of the number of worlds, or the
program decides something for all worlds at once and is refused.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..types import Arg, Node, Part, RewardGraph
from .trace import Refused, Tracer
from .validate import needed


def refuse_sizes(seen: Tracer, graph: RewardGraph, forced: Tracer, other: RewardGraph | None) -> None:
    """Raises Refused where the graph changes once its masks are forced to pick all or nothing.

    Args:
        seen: the tracer that recorded `graph`.
        forced: the tracer with forced masks, which recorded `other`.
        other: None where the program failed with forced masks, as `max()` of an empty tensor does.
    """
    kept = needed(graph, graph.reward, *(index for _, index in graph.components))
    pairs = enumerate(zip(seen.nodes, forced.nodes, strict=False))
    changed = (index for index, (left, right) in pairs if index in kept and repr(left) != repr(right))
    place = next(changed, None)
    if place is None and other and (graph.reward, graph.components) != (other.reward, other.components):
        place = min(len(seen.nodes), len(forced.nodes))
    if place is None:
        return
    raise Refused(
        "branch",
        "how many elements this mask picks decides what is computed, and one decision would hold for all worlds",
        "compute it for all worlds and pick with torch.where(mask, a, b)",
        next((seen.lines[index] for index in reversed(seen.selections) if index < place), None),
    )


def unify(first: RewardGraph, second: RewardGraph, sizes: tuple[int, int], lines: Sequence[int | None]) -> RewardGraph:
    """One graph for any number of worlds, from traces with two numbers of worlds. An integer that is k times the number
    of worlds in both becomes `{"n": k}`. Raises Refused where the traces differ in any other way.

    Args:
        lines: the program's line for each node of `first`.
    """
    nodes: list[Node] = []
    for left, right, line in zip(first.nodes, second.nodes, lines, strict=False):
        try:
            nodes.append(_unified(left, right, sizes))
        except ValueError:
            raise _depends_on_count(line) from None
    if len(first.nodes) != len(second.nodes) or (first.reward, first.components) != (second.reward, second.components):
        raise _depends_on_count(lines[-1])
    return RewardGraph(nodes=tuple(nodes), reward=first.reward, components=first.components)


def _depends_on_count(line: int | None) -> Refused:
    return Refused(
        "world-count",
        "what the program computes depends on the number of worlds or on the values it saw",
        "treat all worlds alike: no loop over worlds, no numbers taken from tensors",
        line,
    )


def _unified(left: Node, right: Node, sizes: tuple[int, int]) -> Node:
    """Raises ValueError where the nodes differ in more than multiples of the number of worlds."""
    if left.op != right.op or left.kwargs.keys() != right.kwargs.keys():
        raise ValueError
    args = tuple(_unified_arg(a, b, sizes) for a, b in zip(left.args, right.args, strict=True))
    return Node(left.op, args, {key: _unified_arg(arg, right.kwargs[key], sizes) for key, arg in left.kwargs.items()})


def _unified_arg(left: Arg, right: Arg, sizes: tuple[int, int]) -> Arg:
    if isinstance(left, tuple) and isinstance(right, tuple):
        return tuple(_unified_part(a, b, sizes) for a, b in zip(left, right, strict=True))
    if isinstance(left, tuple) or isinstance(right, tuple):
        raise ValueError
    return _unified_part(left, right, sizes)


def _unified_part(left: Part, right: Part, sizes: tuple[int, int]) -> Part:
    if type(left) is type(right) and (left == right or (left != left and right != right)):
        return left
    if type(left) is int and type(right) is int:
        factor = left // sizes[0]
        if left == factor * sizes[0] and right == factor * sizes[1]:
            return {"n": factor}
    raise ValueError
