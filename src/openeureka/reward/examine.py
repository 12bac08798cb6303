"""The contract of a reward graph, judged on recorded states by running allow-listed operations only.

Every candidate's graph is judged here, in a separate confined child (`sandbox.server`) that runs nothing else. If an
operation ends that process or runs out of memory, this only leads to a verdict on the candidate.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from ..types import Arg, Finding, Node, RewardGraph, StateSpec
from . import graph as graphs
from . import surface
from .probe import TRACE_SIZES, Traced, outputs
from .states import Recorded, only, take, world_count
from .trace import Refused
from .validate import MAX_SIZE_PER_WORLD, MAX_TOTAL_PER_WORLD, inputs, leaves, needed, references, validate

MAX_REWARD = 1e6
MAX_CALL_SECONDS = 0.5
"""Processor time of one call with as many worlds as in training; a usual reward takes a few milliseconds."""
_MAY_SHRINK = surface.words("""
    arange.start arange.start_step diagonal.default linspace.default slice.Tensor slice_scatter.default split.Tensor
    split_with_sizes.default
""")
_PICKS = surface.words("""
    diagonal gather index index_select narrow new_full new_ones new_zeros select slice split split_with_sizes squeeze
    take unbind
""")
"""Operations that pick worlds, or that read no more of a tensor than its dtype."""
_SCANS = {
    "_log_softmax": 1, "_softmax": 1, "cummax": 1, "cummin": 1, "cumprod": 1, "cumsum": 1, "flip": 1, "roll": 2,
    "sort": 1, "topk": 2,
}  # fmt: skip
"""Operations that compute each element along an axis from the others, with the axis's position in their arguments."""
_MANY_WORLDS = 4 * MAX_SIZE_PER_WORLD
"""Enough worlds for a value that grows with their square to break the limit per world."""


def examine(traced: Traced, spec: StateSpec, recorded: Recorded, worlds: int = 0) -> tuple[Finding, ...]:
    """Why a graph may not train on this task; empty when it may. Runs allow-listed operations only.

    Args:
        worlds: per lane in training; 0 where that is not known.
    """
    try:
        validate(traced.graph)
        paying = _examine_inputs(traced.graph, spec)
        case = _Case(traced, spec, only(recorded, spec, inputs(traced.graph)), worlds)
        _examine_memory(case)
        _examine_values(case)
        _examine_reductions(case, paying)
    except Refused as refusal:
        return (refusal.finding,)
    except Exception as error:  # a forged graph may call an operation in any wrong way
        return (Finding(rule="operation", message=f"its graph does not run: {_text(error)}"),)
    return ()


@dataclass(frozen=True, slots=True)
class _Case:
    """A graph, and the states that it is judged on."""

    traced: Traced
    spec: StateSpec
    recorded: Recorded
    worlds: int
    """Per lane in training; 0 where that is not known."""

    @property
    def graph(self) -> RewardGraph:
        return self.traced.graph

    @property
    def count(self) -> int:
        """The number of recorded worlds."""
        return world_count(self.recorded, self.spec)

    @property
    def more(self) -> int:
        """The number of worlds in training; if that is not above the number of recorded worlds, a number that is."""
        return self.worlds if self.worlds > self.count else 2 * self.count + 1

    def line(self, index: int) -> int | None:
        return self.traced.lines[index] if index < len(self.traced.lines) else None

    def shapes(self, count: int) -> Iterator[Any]:
        """The shape of each node's value in turn, for `count` worlds: tensors on the meta device."""
        state = {name: _meta(name, value, self.spec, count) for name, value in self.recorded.items()}
        return graphs.values(self.graph, state, count, "meta")


def _text(error: Exception) -> str:
    return str(error).splitlines()[0][:200] if str(error) else type(error).__name__


def _examine_inputs(graph: RewardGraph, spec: StateSpec) -> set[int]:
    """The nodes that the reward depends on."""
    unknown = [name for name in inputs(graph) if name not in spec]
    if unknown:
        raise Refused("unknown-input", f"`{unknown[0]:.60}` is not a state variable of this task")
    paying = needed(graph, graph.reward)
    nodes = (graph.nodes[index] for index in paying)
    if not any(node.op == "input" and node.args[0] in spec.per_world for node in nodes):
        raise Refused("constant-reward", "the reward does not depend on the state", "use the state variables")
    return paying


def _examine_memory(case: _Case) -> None:
    """Measure shapes before any number is computed: for as many worlds as in training, for more than were recorded, and
    for `_MANY_WORLDS`.

    A shape that shrinks as worlds are added can be small for few and for many worlds and large in between. If a graph
    may have one, powers of two are measured too.
    """
    counts = {case.worlds or case.more, case.more, _MANY_WORLDS}
    if any(node.op in _MAY_SHRINK and _grows_with_worlds(node) for node in case.graph.nodes):
        counts |= {1 << power for power in range(_MANY_WORLDS.bit_length() - 1)}
    for count in sorted(counts):
        total, index = 0, -1
        seen: list[Any] = []
        try:
            for index, value in enumerate(case.shapes(count)):
                seen.append(value)
                size = _size(value)
                total += size
                if size > count * MAX_SIZE_PER_WORLD or total > count * MAX_TOTAL_PER_WORLD:
                    raise _too_large(case.line(index))
        except (IndexError, RuntimeError, TypeError, ValueError) as error:
            message = f"its graph does not run with {count} worlds: {_text(error)}"
            fix = "treat all worlds alike, however many there are"
            sources = (i for i in needed(case.graph, index + 1) if i <= index)
            if any(_picks_by_mask(case.graph.nodes[i], seen, count) for i in sources):
                fix = "pick columns by number, as in `x[:, [0, 2]]`, not by a mask"
            raise Refused("operation", message, fix, case.line(index + 1)) from None


def _picks_by_mask(node: Node, seen: Sequence[Any], count: int) -> bool:
    """Whether a node picks by a mask that is not one over worlds. How many it picks is unknown before it runs."""
    if node.op != "index.Tensor":
        return False
    indices = (seen[source] for source in references(node)[1:])
    return any(isinstance(i, Tensor) and i.dtype == torch.bool and count not in i.shape for i in indices)


def _grows_with_worlds(node: Node) -> bool:
    """Whether an argument of a node is a multiple of the number of worlds."""
    return any(isinstance(leaf, Mapping) and "n" in leaf for leaf in leaves(node))


def _size(value: Any) -> int:
    """Numbers in the value of a node, which may be several tensors."""
    return value.numel() if isinstance(value, Tensor) else sum(part.numel() for part in value)


def _too_large(line: int | None) -> Refused:
    return Refused(
        "memory",
        "a tensor here grows with the square of the number of worlds or is far too large",
        "check for (N,) against (N, 1) and keep one row per world",
        line,
    )


def _meta(name: str, value: Tensor | float | int, spec: StateSpec, count: int) -> Any:
    if not isinstance(value, Tensor):
        return count if name in spec and spec[name].kind == "num_envs" else value
    shape = (count, *value.shape[1:]) if name in spec.per_world else value.shape
    return torch.empty(shape, dtype=value.dtype, device="meta")


def _examine_values(case: _Case) -> None:
    graph, count = case.graph, case.count
    with torch.no_grad():
        done = list(graphs.values(graph, case.recorded, count))
    reward, components = outputs((done[graph.reward], {name: done[i] for name, i in graph.components}), count)
    for name, index in graph.components:
        if components[name] is not done[index]:  # `outputs` took a mean; a probe writes it into the graph
            raise Refused("components", f"component `{name}` is not one number per world", "use a tensor of shape (N,)")
    for name, index in _named_outputs(graph):
        bad = ~torch.isfinite(done[index].double())
        if bad.any():
            line = next((case.line(i) for i, value in enumerate(done) if _makes_bad(graph, done, i, value)), None)
            message = f"{name} is NaN or infinite in {int(bad.sum())} of {count} recorded states"
            raise Refused("nan", message, "guard divisions, sqrt, log, acos and large exponents with clamp", line)
    largest = float(reward.double().abs().max())
    if largest > MAX_REWARD:
        raise Refused("magnitude", f"the reward reaches {largest:.3g}", f"keep it within {MAX_REWARD:.0e}")
    _examine_independence(case, done)


def _examine_reductions(case: _Case, paying: Set[int]) -> None:
    """Refuse a reward that reduces, scans or sorts over worlds, even if the result was the same in all recorded states,
    such as whether any world presses too hard. A single element of a scan or sort depends on all worlds, too.
    Operations that only pick worlds are judged by values: what they pick may be the same for all worlds.
    """
    small, large = (list(case.shapes(count)) for count in TRACE_SIZES)
    grows = [_size(a) != _size(b) for a, b in zip(small, large, strict=True)]
    for index in sorted(paying):
        node = case.graph.nodes[index]
        among = any(grows[source] for source in references(node))
        reduced = among and not grows[index] and node.op.partition(".")[0] not in _PICKS
        if reduced or _scans_worlds(node, small, large):
            raise _coupled("the reward", case.line(index))


def _scans_worlds(node: Node, small: Sequence[Any], large: Sequence[Any]) -> bool:
    """Whether a node scans an axis that grows with the number of worlds."""
    name = node.op.partition(".")[0]
    if name not in _SCANS:
        return False
    source = next(iter(references(node)))
    grown = [a != b for a, b in zip(small[source].shape, large[source].shape, strict=True)]
    unsaid: Arg = () if name == "roll" else -1  # `roll` without an axis rolls the flattened tensor
    place = _SCANS[name]
    given = node.args[place] if place < len(node.args) else unsaid
    said = node.kwargs.get("dim", node.kwargs.get("dims", given))
    axes = said if isinstance(said, tuple) else (said,)
    return any(grown) if not axes else any(grown[axis] for axis in axes if isinstance(axis, int) and grown)


def _named_outputs(graph: RewardGraph) -> list[tuple[str, int]]:
    return [("the reward", graph.reward), *((f"component `{name}`", index) for name, index in graph.components)]


def _makes_bad(graph: RewardGraph, done: Sequence[Any], index: int, value: Any) -> bool:
    """Whether a node turns finite numbers into ones that are not."""
    if not isinstance(value, Tensor) or torch.isfinite(value.double()).all():
        return False
    sources = [done[source] for source in references(graph.nodes[index])]
    return bool(sources) and all(isinstance(s, Tensor) and torch.isfinite(s.double()).all() for s in sources)


def _examine_independence(case: _Case, whole: Sequence[Any]) -> None:
    """Each world's value must be the same whichever other worlds are there, fewer than recorded or more."""
    count, generator = case.count, torch.Generator().manual_seed(0)
    shuffled = torch.randperm(count, generator=generator)
    more = torch.randint(count, (case.more,), generator=generator)
    few = [shuffled[: case.worlds]] if 0 < case.worlds < count else []
    for chosen in (torch.tensor([count // 2]), shuffled[:7], shuffled[:64], *few, shuffled, more):
        _examine_among(case, whole, chosen)


def _examine_among(case: _Case, whole: Sequence[Any], chosen: Tensor) -> None:
    graph, count = case.graph, case.count
    outputs_of = dict(_named_outputs(graph))
    state, found, index = take(case.recorded, case.spec, chosen), {}, -1
    started = time.thread_time()
    try:
        with torch.no_grad():
            for index, value in enumerate(graphs.values(graph, state, len(chosen))):
                if index in outputs_of.values():
                    found[index] = value
    except (IndexError, RuntimeError) as error:  # such as for `x[1]` with a single world
        if "allocate memory" in str(error):
            raise _too_large(case.line(index + 1)) from None
        raise _coupled("the reward", case.line(index + 1)) from None
    seconds = time.thread_time() - started
    if seconds > MAX_CALL_SECONDS:
        message = f"one call takes {seconds:.1f} s with {len(chosen)} worlds"
        raise Refused("slow", message, "use fewer and smaller tensors: every step of the training waits for it")
    for name, place in outputs_of.items():
        if _differs(found[place], whole[place], chosen, count):
            parts = zip(graphs.values(graph, state, len(chosen)), whole, strict=True)
            first = next(i for i, (part, among) in enumerate(parts) if _differs(part, among, chosen, count))
            raise _coupled(name, case.line(first))


def _coupled(name: str, line: int | None) -> Refused:
    message = f"{name} of one world depends on the other worlds"
    fix = (
        "reduce over the last dimension (dim=-1) only, never over all worlds, and use neither the number nor the order "
        "of worlds"
    )
    return Refused("coupling", message, fix, line)


def _differs(part: Any, whole: Any, worlds: Tensor, count: int) -> bool:
    """Whether a per-world value computed for some worlds differs from the one computed among all worlds.

    Values without a world axis are not judged: a batch mean as a component is only recorded and pays no world.
    """
    if not isinstance(whole, Tensor) or whole.dim() == 0 or whole.shape[0] != count:
        return False
    if part.shape != (len(worlds), *whole.shape[1:]):
        return True
    return not torch.allclose(part.double(), whole[worlds].double(), rtol=1e-4, atol=1e-5, equal_nan=True)
