"""Runs a reward program on recorded states, in the confined child, and traces it to a graph."""

from __future__ import annotations

import contextlib
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import torch
from torch import Tensor

from ..types import RewardGraph, StateSpec
from . import graph as graphs
from .gate import FILENAME
from .load import Runner
from .states import Recorded, take, world_count
from .surface import MAX_COMPONENTS
from .trace import Guard, Outputs, Refused, Tracer, branch, trace
from .unify import refuse_sizes, unify
from .validate import COMPONENT_NAME, GraphError, validate

TRACE_SIZES = (61, 89)
"""Two numbers of worlds that no program contains by chance."""
MAX_ERROR = 400
"""Characters kept of an error message: torch adds lines on what a function takes."""
RESULT_RULES = ("returns", "shape", "dtype", "components", "nondeterminism", "constant-reward", "magnitude")
"""Rules about the result as a whole. Their findings name the line of the `return`."""


@dataclass(frozen=True, slots=True)
class Traced:
    """The graph of a program. `lines` holds the program's line for each node, for messages about the graph."""

    graph: RewardGraph
    lines: tuple[int | None, ...]


# --- running a program -----------------------------------------------------------------------------------------------


_SCALAR_READS = (
    "Boolean value of Tensor",
    "only one element tensors can be converted",
    "only integer tensors of a single",
)
"""How torch's messages begin where a program branches on many worlds at once."""


def _run(run: Runner, state: Mapping[str, Any]) -> object:
    """Run a program; whatever it raises becomes a finding with the program's line."""
    try:
        return run(state)
    except Refused:
        raise
    except BaseException as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == FILENAME]
        line = lines[-1] if lines else None
        text = " ".join(str(error).split())[:MAX_ERROR] or "no message"
        if text.startswith(_SCALAR_READS):
            raise branch(line) from None
        count = state["num_envs"]
        shapes = ", ".join(f"{name} {_symbolic(value, count)}" for name, value in _tensors(state).items())
        raise Refused("error", f"{type(error).__name__}: {text}", f"input shapes: {shapes}", line) from None


def outputs(result: object, num_worlds: int) -> Outputs:
    """The total reward and its components from what a program returned. Raises Refused when it is not
    `(reward, components)` with one number per world."""
    parts = cast(tuple[object, ...], result) if isinstance(result, tuple) else ()
    if len(parts) != 2 or not isinstance(parts[1], dict):
        kind = f"a tuple of {len(parts)}" if isinstance(result, tuple) else type(result).__name__
        raise Refused(
            "returns", f"the program returns {kind:.40}", "return `(reward, components)`, a tensor and a dict"
        )
    reward, components = parts[0], cast(dict[object, object], parts[1])
    if not isinstance(reward, Tensor):
        raise Refused("shape", "the reward is not a tensor", "return one number per world, shape (N,)")
    _check_tensor("the reward", reward)
    if reward.shape != (num_worlds,):
        fix = "one number per world is needed, shape (N,): sum or index the last dimension, or squeeze(-1)"
        raise Refused("shape", f"the reward has shape {_symbolic(reward, num_worlds)}", fix)
    if len(components) > MAX_COMPONENTS:
        message = f"{len(components)} components"
        raise Refused("components", message, f"return at most {MAX_COMPONENTS}")
    named: dict[str, Tensor | float] = {}
    for key, value in components.items():
        name = component_name(key)
        if name in named:
            raise Refused("components", f"two components are named `{name}`", "give each its own name")
        named[name] = _component(name, value, num_worlds)
    return reward, named


def component_name(key: object) -> str:
    """A component's name, with unusual characters replaced."""
    told = repr(key) if isinstance(key, str | int | float) else f"a {type(key).__name__}"
    message = f"{told:.40} is no proper name of a component"
    if not isinstance(key, str) or not 0 < len(key) <= 64:
        raise Refused("components", message, "use short names such as `distance`")
    name = re.sub(r"[^A-Za-z0-9]+", "_", key).strip("_")
    if not COMPONENT_NAME.fullmatch(name):
        raise Refused("components", message, "start its name with a letter from A to Z")
    return name


def _component(name: str, value: object, num_worlds: int) -> Tensor | float:
    if isinstance(value, bool | int | float):
        return float(value)
    if not isinstance(value, Tensor):
        message = f"component `{name}` is a {type(value).__name__:.30}"
        raise Refused("components", message, "use a tensor of shape (N,) or a number")
    _check_tensor(f"component `{name}`", value)
    if value.numel() == 0:
        raise Refused("shape", f"component `{name}` is empty", "use a tensor of shape (N,) or a number")
    if value.shape in ((num_worlds,), ()):
        return value
    # A component is only recorded, so one value per joint or finger may become their mean: the curve is the same.
    per_world = value.shape[0] == num_worlds
    return value.float().flatten(1 if per_world else 0).mean(dim=-1)


def _check_tensor(what: str, value: Tensor) -> None:
    plain = value.layout == torch.strided and value.device.type == "cpu" and not value.is_quantized
    if type(value) is not Tensor or not plain or value.is_complex():
        raise Refused("dtype", f"{what} is not a plain real tensor ({value.dtype}, {value.layout})", "use float32")


def _symbolic(value: Tensor, num_worlds: int) -> str:
    sizes = ["N" if size == num_worlds else str(size) for size in value.shape]
    return f"({', '.join(sizes)}{',' if len(sizes) == 1 else ''})"


# --- the program's contract ------------------------------------------------------------------------------------------


def probe(run: Runner, spec: StateSpec, recorded: Recorded, worlds: int = 0) -> Traced:
    """Run a program on recorded states, hold it to the contract and trace it.

    Args:
        worlds: per lane in training; 0 where that is not known.

    Raises:
        Refused: at the first rule it breaks.
    """
    trial, everyone = _Trial(run, spec, recorded), range(world_count(recorded, spec))
    eager = trial.watched(everyone)
    again = outputs(_run(run, trial.state(everyone)), len(everyone))
    if len(eager[1]) != len(again[1]) or not all(map(_same, _flat(eager), _flat(again))):
        raise Refused("nondeterminism", "the same states give another reward on the second call", "keep no state")
    unified, lines = trial.unified()
    graph, origin = graphs.simplify(unified)
    _compare(graph, trial.state(everyone), eager)
    if worlds not in (0, len(everyone)):
        state = trial.state(range(worlds))
        _compare(graph, state, outputs(_run(run, state), worlds), rule="world-count")
    return Traced(graph, tuple(lines[index] for index in origin))


@dataclass(frozen=True, slots=True)
class _Trial:
    """A program, and the recorded states that it runs on."""

    run: Runner
    spec: StateSpec
    recorded: Recorded

    def state(self, worlds: Sequence[int]) -> dict[str, Any]:
        """States of some worlds, with what every program may read besides the task's table."""
        return {"num_envs": len(worlds), "device": torch.device("cpu"), **take(self.recorded, self.spec, worlds)}

    def watched(self, worlds: Sequence[int]) -> Outputs:
        """The program's outputs. Raises Refused if it edits its inputs, draws random numbers or reads values."""
        state = self.state(worlds)
        guard = Guard(_tensors(state))
        with torch.no_grad(), guard:
            result = _run(self.run, state)
        if guard.refusal is not None:
            raise guard.refusal
        for name, before in _tensors(self.state(worlds)).items():
            if not _same(state[name], before):
                raise Refused("input-edit", f"the program changes its input `{name}`", f"work on `{name}.clone()`")
        reward, components = outputs(result, len(worlds))
        clones = {name: value.clone() if isinstance(value, Tensor) else value for name, value in components.items()}
        return reward.clone(), clones

    def traced(self, tracer: Tracer, worlds: Sequence[int]) -> RewardGraph:
        state = self.state(worlds)

        def from_tensors(tensors: Mapping[str, Tensor]) -> Outputs:
            return outputs(_run(self.run, {**state, **tensors}), len(worlds))

        return trace(tracer, from_tensors, _tensors(state))

    def unified(self) -> tuple[RewardGraph, list[int | None]]:
        """One graph from traces of two sizes on different worlds, and the program's line for each node."""
        small, large = TRACE_SIZES
        tracer, worlds = Tracer(small), _paired(0, small)
        one = self.traced(tracer, worlds)
        for every in (True, False) if tracer.selections else ():
            forced, found = Tracer(small, every), None
            with contextlib.suppress(Refused):
                found = self.traced(forced, worlds)
            refuse_sizes(tracer, one, forced, found)
        other = self.traced(Tracer(large), _paired(small, large))
        return unify(one, other, TRACE_SIZES, tracer.lines), tracer.lines


def _tensors(state: Mapping[str, Any]) -> dict[str, Tensor]:
    return {name: value for name, value in state.items() if isinstance(value, Tensor)}


def _same(a: Tensor | float, b: Tensor | float) -> bool:
    first, second = torch.as_tensor(a), torch.as_tensor(b)
    if first.shape != second.shape or first.dtype != second.dtype:
        return False
    return bool(((first == second) | (first.isnan() & second.isnan())).all())


def _flat(result: Outputs) -> list[Tensor | float]:
    return [result[0], *result[1].values()]


def _paired(first: int, count: int) -> list[int]:
    """Indices of worlds, each at least twice: if a mask picks a single one, torch computes `x[mask] = y` otherwise."""
    return [first + min(place, count - 2) // 2 for place in range(count)]


def _compare(graph: RewardGraph, state: Mapping[str, Any], eager: Outputs, rule: str = "graph-mismatch") -> None:
    try:
        validate(graph)
        done = list(graphs.values(graph, state, state["num_envs"]))
    except (GraphError, RuntimeError, IndexError, TypeError) as error:
        raise Refused("operation", f"it cannot be written as a graph: {str(error)[:200]}", "simplify it") from None
    found = [done[graph.reward], *(done[index] for _, index in graph.components)]
    called = ("the reward", *(f"component `{name}`" for name, _ in graph.components))
    for name, value, expected in zip(called, found, map(torch.as_tensor, _flat(eager)), strict=True):
        if not torch.allclose(value.double(), expected.double(), rtol=1e-4, atol=1e-5, equal_nan=True):
            if rule == "world-count":
                message = f"with {state['num_envs']} worlds the program computes something else"
                raise Refused(rule, message, "treat all worlds alike, however many there are")
            message = f"the traced graph and the program disagree on {name}"
            raise Refused(rule, message, "use plain tensor operations")
