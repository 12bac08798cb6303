"""The contract of a reward graph, judged on recorded states by running allow-listed operations only.

The parent judges every graph here, whoever made it, and trusts nothing else that a child says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from ..types import Finding, RewardGraph, StateSpec
from . import graph as graphs
from .probe import Traced, outputs
from .states import Recorded, is_world, only, take, world_count
from .trace import Refused
from .validate import MAX_SIZE_PER_WORLD, MAX_TOTAL_PER_WORLD, inputs, references, validate

MAX_REWARD = 1e6
_MANY_WORLDS = 4 * MAX_SIZE_PER_WORLD


def examine(traced: Traced, spec: StateSpec, recorded: Recorded) -> tuple[Finding, ...]:
    """Why a graph may not train on this task; empty when it may. Runs allow-listed operations only."""
    try:
        validate(traced.graph)
        _examine_inputs(traced.graph, spec)
        recorded = only(recorded, spec, inputs(traced.graph))
        _examine_memory(traced, spec, recorded)
        _examine_values(traced, spec, recorded)
    except Refused as refusal:
        return (refusal.finding,)
    except Exception as error:  # a forged graph may call an operation in any wrong way
        text = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        return (Finding(rule="operation", message=f"its graph does not run: {text}"),)
    return ()


def _line(traced: Traced, index: int) -> int | None:
    return traced.lines[index] if index < len(traced.lines) else None


def _examine_inputs(graph: RewardGraph, spec: StateSpec) -> None:
    unknown = [name for name in inputs(graph) if name not in spec]
    if unknown:
        raise Refused("unknown-input", f"`{unknown[0]:.60}` is not a state variable of this task")
    needed = {graph.reward}
    for index in reversed(range(len(graph.nodes))):
        if index in needed:
            needed.update(references(graph.nodes[index]))
    if not any(
        graph.nodes[index].op == "input" and is_world(str(graph.nodes[index].args[0]), spec) for index in needed
    ):
        raise Refused("constant-reward", "the reward does not depend on the state", "use the state variables")


def _examine_memory(traced: Traced, spec: StateSpec, recorded: Recorded) -> None:
    """Shapes for so many worlds that a value which grows with their square breaks the limit per world."""
    _measured(traced, {name: _meta(name, value, spec) for name, value in recorded.items()}, _MANY_WORLDS, "meta")


def _measured(traced: Traced, state: Recorded, count: int, device: str = "cpu") -> list[Any]:
    """The value of every node; refused at the first too large one, before anything is built from it."""
    done: list[Any] = []
    total = 0
    for index, value in enumerate(graphs.values(traced.graph, state, count, device)):
        size = value.numel() if isinstance(value, Tensor) else 0
        total += size
        if size > count * MAX_SIZE_PER_WORLD or total > count * MAX_TOTAL_PER_WORLD:
            raise _too_large(traced, index)
        done.append(value)
    return done


def _too_large(traced: Traced, index: int) -> Refused:
    return Refused(
        "memory",
        "a tensor here grows with the square of the number of worlds or is far too large",
        "check for (N,) against (N, 1) and keep one row per world",
        _line(traced, index),
    )


def _meta(name: str, value: Tensor | float | int, spec: StateSpec) -> Any:
    if not isinstance(value, Tensor):
        return value
    shape = (_MANY_WORLDS, *value.shape[1:]) if is_world(name, spec) else value.shape
    return torch.empty(shape, dtype=value.dtype, device="meta")


def _examine_values(traced: Traced, spec: StateSpec, recorded: Recorded) -> None:
    graph, count = traced.graph, world_count(recorded, spec)
    with torch.no_grad():
        done = _measured(traced, recorded, count)
    reward, components = outputs((done[graph.reward], {name: done[i] for name, i in graph.components}), count)
    for name, index in graph.components:
        if components[name] is not done[index]:  # a probe writes the mean per world into the graph
            raise Refused("components", f"component `{name}` is not one number per world", "use a tensor of shape (N,)")
    for name, index in _named_outputs(graph):
        bad = ~torch.isfinite(done[index].double())
        if bad.any():
            line = next((_line(traced, i) for i, value in enumerate(done) if _makes_bad(graph, done, i, value)), None)
            message = f"{name} is NaN or infinite in {int(bad.sum())} of {count} recorded states"
            raise Refused("nan", message, "guard divisions, sqrt, log, acos and large exponents with clamp", line)
    largest = float(reward.double().abs().max())
    if largest > MAX_REWARD:
        raise Refused("magnitude", f"the reward reaches {largest:.3g}", f"keep it within {MAX_REWARD:.0e}")
    _examine_independence(traced, spec, recorded, done, count)


def _named_outputs(graph: RewardGraph) -> list[tuple[str, int]]:
    return [("the reward", graph.reward), *((f"component `{name}`", index) for name, index in graph.components)]


def _makes_bad(graph: RewardGraph, done: Sequence[Any], index: int, value: Any) -> bool:
    """Whether a node is the first to turn finite numbers into others."""
    if not isinstance(value, Tensor) or torch.isfinite(value.double()).all():
        return False
    sources = [done[source] for source in references(graph.nodes[index])]
    return bool(sources) and all(isinstance(s, Tensor) and torch.isfinite(s.double()).all() for s in sources)


def _examine_independence(
    traced: Traced, spec: StateSpec, recorded: Recorded, whole: Sequence[Any], count: int
) -> None:
    """Each world's value must be the same whichever other worlds are there."""
    graph = traced.graph
    shuffled = torch.randperm(count, generator=torch.Generator().manual_seed(0)).tolist()
    for worlds in ([count // 2], shuffled[:7], shuffled[:64], shuffled):
        part: list[Any] = []
        try:
            with torch.no_grad():
                part.extend(graphs.values(graph, take(recorded, spec, worlds), len(worlds)))
        except (IndexError, RuntimeError):  # as `x[1]` in a single world
            raise _coupled("the reward", _line(traced, len(part))) from None
        for name, index in _named_outputs(graph):
            if _differs(part[index], whole[index], worlds, count):
                first = next(i for i in range(len(whole)) if _differs(part[i], whole[i], worlds, count))
                raise _coupled(name, _line(traced, first))


def _coupled(name: str, line: int | None) -> Refused:
    message = f"{name} of one world depends on the other worlds"
    return Refused("coupling", message, "reduce over the last dimension (dim=-1) only, never over all worlds", line)


def _differs(part: Any, whole: Any, worlds: Sequence[int], count: int) -> bool:
    """Whether a per-world value computed for some worlds is not what it is among all of them.

    Values without a world axis are not judged: a batch mean as a component is a record that pays no world.
    """
    if not isinstance(whole, Tensor) or whole.dim() == 0 or whole.shape[0] != count:
        return False
    if part.shape != (len(worlds), *whole.shape[1:]):
        return True
    return not torch.allclose(part.double(), whole[worlds].double(), rtol=1e-4, atol=1e-5, equal_nan=True)
