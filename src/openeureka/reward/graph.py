"""Simplifies, interprets and compiles reward graphs, and writes them as Python for others."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, cast

import torch
from torch import Tensor, fx

from ..types import Arg, Node, Part, RewardGraph, StateSpec
from . import surface
from .validate import TORCH_NAMES, GraphError, inputs, needed, operation, references, refuse_truncation, validate

MADE_FROM_NOTHING = surface.words("""
    arange.default arange.start arange.start_step eye.default eye.m full.default linspace.default ones.default
    scalar_tensor.default zeros.default
""")
"""Operations that take no tensor and so must be told the device."""
State = Mapping[str, Tensor | float | int]


# --- data ------------------------------------------------------------------------------------------------------------


def simplify(graph: RewardGraph) -> tuple[RewardGraph, tuple[int, ...]]:
    """Drop nodes that no output needs and merge equal ones. Also returns the old index of each remaining node."""
    place: dict[int, int] = {}
    seen: dict[str, int] = {}
    nodes: list[Node] = []
    origin: list[int] = []
    for index in sorted(needed(graph, graph.reward, *(index for _, index in graph.components))):
        old = graph.nodes[index]
        args = tuple(_moved(arg, place) for arg in old.args)
        node = Node(old.op, args, {key: _moved(arg, place) for key, arg in old.kwargs.items()})
        key = repr((node.op, node.args, sorted(node.kwargs.items())))
        if key not in seen:
            seen[key] = len(nodes)
            nodes.append(node)
            origin.append(index)
        place[index] = seen[key]
    components = tuple((name, place[index]) for name, index in graph.components)
    return RewardGraph(nodes=tuple(nodes), reward=place[graph.reward], components=components), tuple(origin)


def _moved(arg: Arg, place: Mapping[int, int]) -> Arg:
    return tuple(_moved_part(part, place) for part in arg) if isinstance(arg, tuple) else _moved_part(arg, place)


def _moved_part(part: Part, place: Mapping[int, int]) -> Part:
    return {"ref": place[part["ref"]]} if isinstance(part, Mapping) and "ref" in part else part


# --- execution -------------------------------------------------------------------------------------------------------


def _guarded(divide: Callable[..., Any]) -> Callable[..., Any]:
    def guarded(input: Any, other: Any, *, rounding_mode: str | None = None) -> Tensor:
        refuse_truncation(input, other, rounding_mode)
        return divide(input, other, rounding_mode=rounding_mode)

    return guarded


_COPIES = {"view.default": "reshape.default"}
"""Operations that run in place of others. Tracing records a reshape as a view, because the tensors that it sees are
contiguous. A task's tensors may be slices, which allow a reshape only. On equal tensors both give the same."""
_GUARDED = {op: _guarded(operation(op)) for op in ("div.Tensor_mode", "div.Scalar_mode")}


def _callable(op: str) -> Callable[..., Any]:
    """The function that runs a node: an ATEN overload, or one that checks its arguments first."""
    return _GUARDED.get(op) or operation(_COPIES.get(op, op))


def _named(kwargs: dict[str, Any]) -> dict[str, Any]:
    """Keyword arguments, with names of torch attributes (such as a dtype) replaced by the attributes."""
    return {k: getattr(torch, v) if k in TORCH_NAMES and v is not None else v for k, v in kwargs.items()}


def _constant(node: Node, device: torch.device | str) -> Tensor:
    values, shape, dtype = node.args
    numbers = torch.tensor(values, dtype=getattr(torch, str(dtype)), device=device)
    return numbers.reshape(cast(tuple[int, ...], shape))


def _filler(done: Sequence[Any], times_worlds: Callable[[int], Any]) -> Callable[[Arg], Any]:
    """A function that prepares an argument for a call: references become the values of earlier nodes.

    Args:
        times_worlds: gives a multiple of the number of worlds.
    """

    def fill(arg: Arg) -> Any:
        if isinstance(arg, tuple):
            return [fill(part) for part in arg]
        if isinstance(arg, Mapping):
            return done[arg["ref"]] if "ref" in arg else times_worlds(arg["n"])
        return arg

    return fill


def _call(node: Node, fill: Callable[[Arg], Any], device: Any) -> tuple[Callable[..., Any], list[Any], dict[str, Any]]:
    """The function that runs a node, its arguments and its keyword arguments."""
    args, kwargs = [fill(arg) for arg in node.args], _named({key: fill(arg) for key, arg in node.kwargs.items()})
    if node.op in MADE_FROM_NOTHING:
        kwargs["device"] = device
    return _callable(node.op), args, kwargs


def values(graph: RewardGraph, state: State, num_worlds: int, device: torch.device | str = "cpu") -> Iterator[Any]:
    """The value of each node in turn: the reference interpreter, for checks. On the meta device it gives shapes only.

    On the meta device, a boolean mask as an index selects every element, which is the largest possible result. A value
    is released after its last use; callers keep those that they need.
    """
    done: list[Any] = []
    last = {source: index for index, node in enumerate(graph.nodes) for source in (index, *references(node))}
    over: list[list[int]] = [[] for _ in graph.nodes]
    for source, index in last.items():
        over[index].append(source)

    fill = _filler(done, lambda times: times * num_worlds)
    for index, node in enumerate(graph.nodes):
        if node.op == "input":
            value = torch.as_tensor(state[str(node.args[0])], device=device)
        elif node.op == "constant":
            value = _constant(node, device)
        elif node.op == "getitem":
            value = _part(fill(node.args[0]), node.args[1])
        else:
            function, args, kwargs = _call(node, fill, device)
            if device == "meta" and node.op == "index.Tensor":
                args[1] = _largest_selection(args[1])
            value = function(*args, **kwargs)
        done.append(value)
        for source in over[index]:
            done[source] = None
        yield value


def _part(parts: Any, position: Any) -> Any:
    if isinstance(parts, Tensor):
        raise GraphError("getitem takes the result of an operation with several")
    return parts[position]


def _largest_selection(indices: Sequence[Tensor | None]) -> list[Tensor | None]:
    every: list[Tensor | None] = []
    for index in indices:
        if index is not None and index.dtype == torch.bool:
            every += [torch.empty(index.numel(), dtype=torch.long, device="meta")] * index.dim()
        else:
            every.append(index)
    return every


class CompiledReward:
    """A graph as a fast function of the state, on the device of its inputs and for any number of worlds.

    Raises:
        GraphError: as `validate`, or for an input that is not in the state table.
    """

    def __init__(self, graph: RewardGraph, spec: StateSpec) -> None:
        validate(graph)
        self.graph = graph
        self.inputs = inputs(graph)
        unknown = [name for name in self.inputs if name not in spec]
        if unknown:
            raise GraphError(f"input {unknown[0]!r:.60} is not a state variable")
        self._world = next((name for name in self.inputs if name in spec.per_world), None)
        self._names = tuple(name for name, _ in graph.components)
        self._module = _module(graph, self.inputs)
        self._device = torch.device("cpu")

    def __call__(self, state: State, num_worlds: int | None = None) -> tuple[Tensor, dict[str, Tensor]]:
        """Reward (N,) and each component (N,), float32, sharing memory with nothing.

        Args:
            state: at least the variables in `inputs`; they are only read.
            num_worlds: N; needed only by a graph that reads no per-world variable.
        """
        tensors = [state[name] for name in self.inputs]
        if num_worlds is None:
            if self._world is None:
                raise ValueError("this reward reads no per-world variable: give num_worlds")
            num_worlds = cast(Tensor, state[self._world]).shape[0]
        device = next((value.device for value in tensors if isinstance(value, Tensor)), self._device)
        if device != self._device:
            self._module.to(device)
            self._device = device
        reward, *components = self._module(*tensors, num_worlds, device)
        own = {name: _own(value, num_worlds) for name, value in zip(self._names, components, strict=True)}
        return _own(reward, num_worlds), own


def _own(value: Tensor, num_worlds: int) -> Tensor:
    return value.to(torch.float32).expand(num_worlds).clone()


def _module(graph: RewardGraph, names: Sequence[str]) -> fx.GraphModule:
    root = torch.nn.Module()
    built = fx.Graph()
    places = {name: built.placeholder(f"in_{index}") for index, name in enumerate(names)}
    count, device = built.placeholder("num_worlds"), built.placeholder("device")
    done: list[fx.Node] = []
    fill = _filler(done, lambda times: count if times == 1 else built.call_function(operator.mul, (count, times)))
    for index, node in enumerate(graph.nodes):
        if node.op == "input":
            done.append(places[str(node.args[0])])
        elif node.op == "constant":
            root.register_buffer(f"constant_{index}", _constant(node, "cpu"), persistent=False)
            done.append(built.get_attr(f"constant_{index}"))
        elif node.op == "getitem":
            done.append(built.call_function(operator.getitem, (fill(node.args[0]), node.args[1])))
        else:
            function, args, kwargs = _call(node, fill, device)
            done.append(built.call_function(function, tuple(args), kwargs))
    built.output((done[graph.reward], *(done[index] for _, index in graph.components)))
    return fx.GraphModule(root, built)


# --- as Python for others --------------------------------------------------------------------------------------------

_HEAD = '''def reward(state):
    """The reward (N,) and its components by name, of state variables by name."""
'''


def spelled(graph: RewardGraph, spec: StateSpec) -> str:
    """Source of `reward(state)`, where `state` holds tensors (N, ...) by the names of the table. It needs `torch`.

    Every line is one allow-listed operation with literal arguments.

    Raises:
        GraphError: for anything but a well-formed graph of such operations.
    """
    validate(graph)
    first = next(name for name in inputs(graph) if name in spec.per_world)
    lines = [f'n, device = state["{first}"].shape[0], state["{first}"].device']
    lines += [f"x{index} = {_value(node)}" for index, node in enumerate(graph.nodes)]
    components = ", ".join(f"{name!r}: {_output(index)}" for name, index in graph.components)
    lines += [f"return {_output(graph.reward)}, {{{components}}}"]
    return _HEAD + "".join(f"    {line}\n" for line in lines)


def _output(index: int) -> str:
    return f"torch.as_tensor(x{index}).to(torch.float32).expand(n)"


def _value(node: Node) -> str:
    if node.op == "input":
        # A task's plain numbers, such as `dt`, become tensors, which operations need.
        return f"torch.as_tensor(state[{node.args[0]!r}], device=device)"
    if node.op == "constant":
        values, shape, dtype = node.args
        return f"torch.tensor({_argument(values)}, dtype=torch.{dtype}, device=device).reshape({_argument(shape)})"
    if node.op == "getitem":
        return f"{_argument(node.args[0])}[{node.args[1]!r}]"
    words = [_argument(arg) for arg in node.args]
    words += [f"{key}={_keyword(key, arg)}" for key, arg in node.kwargs.items()]
    words += ["device=device"] if node.op in MADE_FROM_NOTHING else []
    return f"torch.ops.aten.{_COPIES.get(node.op, node.op)}({', '.join(words)})"


def _keyword(key: str, arg: Arg) -> str:
    return f"torch.{arg}" if key in TORCH_NAMES and arg is not None else _argument(arg)


def _argument(arg: Arg) -> str:
    if isinstance(arg, tuple):
        return f"[{', '.join(map(_argument, arg))}]"
    if isinstance(arg, Mapping):
        return f"x{arg['ref']}" if "ref" in arg else "n" if arg["n"] == 1 else f"n * {arg['n']}"
    return f'float("{arg}")' if isinstance(arg, float) and arg - arg != 0.0 else repr(arg)
