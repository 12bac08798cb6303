"""The contract of a reward: what a program must do on recorded states before anything trains on it.

`probe` runs the program and belongs into the confined child. `examine` runs only the graph that comes out of it, and is
repeated by the parent, which trusts nothing that the child says.
"""

from __future__ import annotations

import builtins
import math
import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import torch
from torch import Tensor

from ..types import Finding, RewardGraph, StateSpec
from . import graph as graphs
from . import math as helper_functions
from . import surface
from .gate import FILENAME, Program
from .trace import Guard, Outputs, Refused, trace, unify

MAX_REWARD = 1e6
TRACE_SIZES = (61, 89)
"""Two world counts that no program writes by chance."""
_MEMORY_SIZES = (1024, 2048)

Recorded = Mapping[str, Tensor | float | int]
Runner = Callable[[Mapping[str, Any]], object]


@dataclass(frozen=True, slots=True)
class Traced:
    """What a program became. `lines` holds the program's line for each node, for messages about the graph."""

    graph: RewardGraph
    lines: tuple[int | None, ...]


# --- the states ------------------------------------------------------------------------------------------------------


def world_count(recorded: Recorded, spec: StateSpec) -> int:
    return next(
        value.shape[0] for name, value in recorded.items() if _is_world(name, spec) and isinstance(value, Tensor)
    )


def _is_world(name: str, spec: StateSpec) -> bool:
    return name in spec and spec[name].kind == "world"


def take(recorded: Recorded, spec: StateSpec, worlds: Sequence[int]) -> dict[str, Any]:
    """Copies of the states of some worlds, repeated where there are too few."""
    count = world_count(recorded, spec)
    index = torch.tensor(worlds) % count
    values: dict[str, Any] = {}
    for name, value in recorded.items():
        if _is_world(name, spec) and isinstance(value, Tensor):
            values[name] = value[index]
        else:
            values[name] = value.clone() if isinstance(value, Tensor) else value
    for variable in spec.variables:
        if variable.kind == "num_envs":
            values[variable.name] = len(worlds)
    return values


# --- running a program -----------------------------------------------------------------------------------------------


def _namespace(module: str, real: Any) -> SimpleNamespace:
    return SimpleNamespace(**{name: getattr(real, name) for name in surface.MODULES[module]})


def _modules() -> SimpleNamespace:
    """Stand-ins that hold the allowed names and nothing else, so that a slip of the gate finds no `torch.os`."""
    offered = _namespace("torch", torch)
    offered.nn = SimpleNamespace(functional=_namespace("torch.nn.functional", torch.nn.functional))
    offered.linalg = _namespace("torch.linalg", torch.linalg)
    offered.device = lambda *_: torch.device("cpu")
    return SimpleNamespace(torch=offered, math=_namespace("math", math))


def load(program: Program) -> Runner:
    """The program as a function of a mapping that holds its inputs."""
    modules = _modules()
    # torch imports lazily from C through the builtins of the running frame, hence `__import__`; the gate lets no program name it.
    allowed = {name: getattr(builtins, name) for name in (*surface.BUILTINS, "__import__")}
    names: dict[str, Any] = {"__builtins__": allowed}
    names.update({name: getattr(helper_functions, name) for name in surface.HELPERS})
    for name, path in program.draft.names.items():
        value: Any = modules
        for part in path.split("."):
            value = getattr(value, part, None)
        names[name] = value
    exec(program.code(), names)  # the gate's plain form: functions and literal constants
    function = names[program.entry]
    free = [name for name in program.inputs if name not in program.arguments]

    def run(state: Mapping[str, Any]) -> object:
        if program.method:
            return function(SimpleNamespace(**{name: state[name] for name in program.inputs}))
        names.update({name: state[name] for name in free})
        return function(**{name: state[name] for name in program.arguments})

    return run


def _guarded(run: Runner, state: Mapping[str, Any]) -> object:
    """Run a program; whatever it raises becomes a finding with the program's line."""
    try:
        return run(state)
    except Refused:
        raise
    except BaseException as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == FILENAME]
        text = (str(error).strip() or "no message").splitlines()[0][:300]
        shapes = ", ".join(f"{name} {_shape(value)}" for name, value in state.items() if isinstance(value, Tensor))
        raise Refused(
            "error", f"{type(error).__name__}: {text}", f"input shapes: {shapes}", lines[-1] if lines else None
        ) from None


def _shape(value: Tensor) -> str:
    return str(tuple(value.shape))


def outputs(result: object, num_worlds: int) -> Outputs:
    """The total reward and its components from what a program returned.

    Raises:
        Refused: when it is not `(reward, components)` with one number per world.
    """
    if not isinstance(result, tuple) or len(result) != 2 or not isinstance(result[1], dict):
        kind = f"a tuple of {len(result)}" if isinstance(result, tuple) else type(result).__name__
        raise Refused(
            "returns", f"the program returns {kind:.40}", "return `(reward, components)`, a tensor and a dict"
        )
    reward, components = result
    if not isinstance(reward, Tensor):
        raise Refused("shape", "the reward is not a tensor", "return one number per world, shape (N,)")
    _check_tensor("the reward", reward)
    if reward.shape != (num_worlds,):
        fix = "one number per world is needed, shape (N,): sum or index the last dimension, or squeeze(-1)"
        raise Refused("shape", f"the reward has shape {_symbolic(reward, num_worlds)}", fix)
    if len(components) > graphs.MAX_COMPONENTS:
        message = f"{len(components)} components"
        raise Refused("components", message, f"return at most {graphs.MAX_COMPONENTS}")
    named: dict[str, Tensor | float] = {}
    for key, value in components.items():
        name = component_name(key)
        if name in named:
            raise Refused("components", f"two components are named `{name}`", "give each its own name")
        named[name] = _component(name, value, num_worlds)
    return reward, named


def component_name(key: object) -> str:
    """A component's name, with unusual characters replaced."""
    if not isinstance(key, str) or not 0 < len(key) <= 64:
        raise Refused("components", "a component has no proper name", "use short names such as `distance`")
    name = re.sub(r"[^A-Za-z0-9]+", "_", key).strip("_")
    if not graphs.COMPONENT_NAME.fullmatch(name):
        raise Refused("components", "a component has no proper name", "start its name with a letter")
    return name


def _component(name: str, value: object, num_worlds: int) -> Tensor | float:
    if isinstance(value, bool | int | float):
        return float(value)
    if not isinstance(value, Tensor):
        message = f"component `{name}` is a {type(value).__name__:.30}"
        raise Refused("components", message, "use a tensor of shape (N,) or a number")
    _check_tensor(f"component `{name}`", value)
    if value.shape not in ((num_worlds,), ()):
        message = f"component `{name}` has shape {_symbolic(value, num_worlds)}"
        raise Refused("shape", message, "one number per world is needed, shape (N,)")
    return value


def _check_tensor(what: str, value: Tensor) -> None:
    plain = value.layout == torch.strided and value.device.type == "cpu" and not value.is_quantized
    if type(value) is not Tensor or not plain or value.is_complex():
        raise Refused("dtype", f"{what} is not a plain real tensor ({value.dtype}, {value.layout})", "use float32")


def _symbolic(value: Tensor, num_worlds: int) -> str:
    sizes = ["N" if size == num_worlds else str(size) for size in value.shape]
    return f"({', '.join(sizes)}{',' if len(sizes) == 1 else ''})"


# --- the program's contract ------------------------------------------------------------------------------------------


def probe(run: Runner, spec: StateSpec, recorded: Recorded) -> Traced:
    """Run a program on recorded states, hold it to the contract and trace it.

    Raises:
        Refused: at the first rule it breaks.
    """
    count = world_count(recorded, spec)
    eager = _run_guarded(run, spec, recorded, count)
    again = outputs(_guarded(run, _whole(take(recorded, spec, range(count)), count)), count)
    if not all(_same_bits(a, b) for a, b in zip(_flat(eager), _flat(again), strict=True)):
        raise Refused("nondeterminism", "the same states give another reward on the second call", "keep no state")
    small, large = TRACE_SIZES
    first, lines = _traced(run, spec, recorded, range(small))
    second, _ = _traced(run, spec, recorded, range(small, small + large))
    graph, origin = graphs.simplify(unify(first, second, TRACE_SIZES, lines))
    try:
        graphs.validate(graph)
    except graphs.GraphError as error:
        raise Refused("operation", f"it cannot be written as a graph: {error}", "simplify it") from None
    _compare(graph, _whole(take(recorded, spec, range(count)), count), eager, count)
    return Traced(graph, tuple(lines[index] for index in origin))


def _whole(state: dict[str, Any], count: int) -> dict[str, Any]:
    """A state with what every program may read besides the task's table."""
    return {"num_envs": count, "device": torch.device("cpu"), **state}


def _tensors(state: Mapping[str, Any]) -> dict[str, Tensor]:
    return {name: value for name, value in state.items() if isinstance(value, Tensor)}


def _run_guarded(run: Runner, spec: StateSpec, recorded: Recorded, count: int) -> Outputs:
    """The program's outputs on all recorded states, refused if it edits them, draws numbers or reads values."""
    state = _whole(take(recorded, spec, range(count)), count)
    guard = Guard(_tensors(state))
    try:
        with torch.no_grad(), guard:
            result = _guarded(run, state)
        if guard.refusal is not None:
            raise guard.refusal
    finally:
        edited = _edited(state, take(recorded, spec, range(count)))
    if edited is not None:
        raise Refused("input-edit", f"the program changes its input `{edited}`", f"work on `{edited}.clone()`")
    reward, components = outputs(result, count)
    clones = {name: value.clone() if isinstance(value, Tensor) else value for name, value in components.items()}
    return reward.clone(), clones


def _edited(state: Mapping[str, Any], original: Mapping[str, Any]) -> str | None:
    for name, before in _tensors(original).items():
        after = state[name]
        if after.shape != before.shape or not _same_bits(after, before):
            return name
    return None


def _same_bits(a: Tensor | float, b: Tensor | float) -> bool:
    a, b = torch.as_tensor(a), torch.as_tensor(b)
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return bool(((a == b) | ((a != a) & (b != b))).all())


def _flat(result: Outputs) -> list[Tensor | float]:
    return [result[0], *result[1].values()]


def _traced(run: Runner, spec: StateSpec, recorded: Recorded, worlds: range) -> tuple[RewardGraph, list[int | None]]:
    state = _whole(take(recorded, spec, worlds), len(worlds))

    def from_tensors(tensors: Mapping[str, Tensor]) -> Outputs:
        return outputs(_guarded(run, {**state, **tensors}), len(worlds))

    return trace(from_tensors, _tensors(state))


def _compare(graph: RewardGraph, state: Mapping[str, Any], eager: Outputs, count: int) -> None:
    done = list(graphs.values(graph, state, count))
    found = [done[graph.reward], *(done[index] for _, index in graph.components)]
    for value, expected in zip(found, _flat(eager), strict=True):
        expected = torch.as_tensor(expected)
        if not torch.allclose(value.double(), expected.double(), rtol=1e-4, atol=1e-5, equal_nan=True):
            raise Refused("graph-mismatch", "the traced graph and the program disagree", "use plain tensor operations")


# --- the graph's contract --------------------------------------------------------------------------------------------


def examine(traced: Traced, spec: StateSpec, recorded: Recorded) -> tuple[Finding, ...]:
    """Why a graph may not train on this task; empty when it may. Runs allow-listed operations only."""
    try:
        graphs.validate(traced.graph)
        _examine_inputs(traced.graph, spec)
        _examine_memory(traced, spec, recorded)
        _examine_values(traced, spec, recorded)
    except Refused as refusal:
        return (refusal.finding,)
    except (graphs.GraphError, RuntimeError, IndexError, TypeError, ValueError) as error:
        text = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        return (Finding(rule="operation", message=f"its graph does not run: {text}"),)
    return ()


def _line(traced: Traced, index: int) -> int | None:
    return traced.lines[index] if index < len(traced.lines) else None


def _examine_inputs(graph: RewardGraph, spec: StateSpec) -> None:
    unknown = [name for name in graphs.inputs(graph) if name not in spec]
    if unknown:
        raise Refused("unknown-input", f"`{unknown[0]:.60}` is not a state variable of this task")
    needed = {graph.reward}
    for index in reversed(range(len(graph.nodes))):
        if index in needed:
            needed.update(graphs.references(graph.nodes[index]))
    if not any(
        graph.nodes[index].op == "input" and _is_world(str(graph.nodes[index].args[0]), spec) for index in needed
    ):
        raise Refused("constant-reward", "the reward does not depend on the state", "use the state variables")


def _examine_memory(traced: Traced, spec: StateSpec, recorded: Recorded) -> None:
    sizes: list[list[int]] = []
    for count in _MEMORY_SIZES:
        state = {name: _meta(name, value, spec, count) for name, value in recorded.items()}
        sizes.append([])
        for index, value in enumerate(graphs.values(traced.graph, state, count, "meta")):
            size = value.numel() if isinstance(value, Tensor) else 0
            sizes[-1].append(size)
            # Judged before the next operation runs, so that nothing large is ever built from it.
            if size > count * graphs.MAX_SIZE_PER_WORLD:
                raise _too_large(traced, index)
    for index, (small, large) in enumerate(zip(*sizes, strict=True)):
        if large > 3 * small and large > 10_000:
            raise _too_large(traced, index)


def _too_large(traced: Traced, index: int) -> Refused:
    return Refused(
        "memory",
        "a tensor here grows with the square of the number of worlds or is far too large",
        "check for (N,) against (N, 1) and keep one row per world",
        _line(traced, index),
    )


def _meta(name: str, value: Tensor | float | int, spec: StateSpec, count: int) -> Any:
    if not isinstance(value, Tensor):
        return value
    shape = (count, *value.shape[1:]) if _is_world(name, spec) else value.shape
    return torch.empty(shape, dtype=value.dtype, device="meta")


def _examine_values(traced: Traced, spec: StateSpec, recorded: Recorded) -> None:
    graph, count = traced.graph, world_count(recorded, spec)
    with torch.no_grad():
        done = list(graphs.values(graph, recorded, count))
    reward = done[graph.reward]
    outputs({} if not isinstance(reward, Tensor) else (reward, {name: done[i] for name, i in graph.components}), count)
    bad = ~torch.isfinite(reward.double())
    if bad.any():
        line = next((_line(traced, i) for i, value in enumerate(done) if _makes_bad(graph, done, i, value)), None)
        message = f"the reward is NaN or infinite in {int(bad.sum())} of {count} recorded states"
        raise Refused("nan", message, "guard divisions, sqrt, log, acos and large exponents with clamp", line)
    largest = float(reward.double().abs().max())
    if largest > MAX_REWARD:
        raise Refused("magnitude", f"the reward reaches {largest:.3g}", f"keep it within {MAX_REWARD:.0e}")
    _examine_independence(traced, spec, recorded, done, count)


def _makes_bad(graph: RewardGraph, done: Sequence[Any], index: int, value: Any) -> bool:
    """Whether a node is the first to turn finite numbers into others."""
    if not isinstance(value, Tensor) or torch.isfinite(value.double()).all():
        return False
    sources = [done[source] for source in graphs.references(graph.nodes[index])]
    return bool(sources) and all(isinstance(s, Tensor) and torch.isfinite(s.double()).all() for s in sources)


def _examine_independence(
    traced: Traced, spec: StateSpec, recorded: Recorded, whole: Sequence[Any], count: int
) -> None:
    """Each world's value must be the same whichever other worlds are there."""
    graph = traced.graph
    shuffled = torch.randperm(count, generator=torch.Generator().manual_seed(0)).tolist()
    for worlds in ([count // 2], shuffled[:7], shuffled[:64], shuffled):
        with torch.no_grad():
            part = list(graphs.values(graph, take(recorded, spec, worlds), len(worlds)))
        differs = [_differs(some, all_, worlds, count) for some, all_ in zip(part, whole, strict=True)]
        for name, index in (("the reward", graph.reward), *((f"component `{n}`", i) for n, i in graph.components)):
            if differs[index]:
                line = _line(traced, differs.index(True))
                message = f"{name} of one world depends on the other worlds"
                fix = "reduce over the last dimension (dim=-1) only, never over all worlds"
                raise Refused("coupling", message, fix, line)


def _differs(part: Any, whole: Any, worlds: Sequence[int], count: int) -> bool:
    """Whether a per-world value computed for some worlds is not what it is among all of them.

    Values without a world axis are not judged: a batch mean as a component is a record that pays no world.
    """
    if not isinstance(whole, Tensor) or whole.dim() == 0 or whole.shape[0] != count:
        return False
    if part.shape != (len(worlds), *whole.shape[1:]):
        return True
    return not torch.allclose(part.double(), whole[worlds].double(), rtol=1e-4, atol=1e-5, equal_nan=True)
