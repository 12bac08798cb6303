"""A reward graph as Python that needs torch alone: the numbers that trained, in anybody's program."""

from __future__ import annotations

from collections.abc import Mapping

from ..types import Arg, Node, RewardGraph, StateSpec
from .graph import MADE_FROM_NOTHING
from .states import is_world
from .validate import TORCH_NAMES, inputs, validate

_HEAD = '''def reward(state):
    """The reward (N,) and its components by name, of state variables by name."""
'''


def spelled(graph: RewardGraph, spec: StateSpec) -> str:
    """Source of `reward(state)`, where `state` holds tensors (N, ...) by the names of the table; it names `torch`.

    Every line is one allow-listed operation with literal arguments.

    Raises:
        GraphError: for anything but a well-formed graph of such operations.
    """
    validate(graph)
    first = next(name for name in inputs(graph) if is_world(name, spec))
    lines = [f'n, device = state["{first}"].shape[0], state["{first}"].device']
    lines += [f"x{index} = {_value(node)}" for index, node in enumerate(graph.nodes)]
    components = ", ".join(f"{name!r}: {_output(index)}" for name, index in graph.components)
    lines += [f"return {_output(graph.reward)}, {{{components}}}"]
    return _HEAD + "".join(f"    {line}\n" for line in lines)


def _output(index: int) -> str:
    return f"torch.as_tensor(x{index}).to(torch.float32).expand(n)"


def _value(node: Node) -> str:
    if node.op == "input":
        # A number of the task, no tensor, is one that operations take.
        return f"torch.as_tensor(state[{node.args[0]!r}], device=device)"
    if node.op == "constant":
        values, shape, dtype = node.args
        return f"torch.tensor({_argument(values)}, dtype=torch.{dtype}, device=device).reshape({_argument(shape)})"
    if node.op == "getitem":
        return f"{_argument(node.args[0])}[{node.args[1]!r}]"
    words = [_argument(arg) for arg in node.args]
    words += [f"{key}={_named(key, arg)}" for key, arg in node.kwargs.items()]
    words += ["device=device"] if node.op in MADE_FROM_NOTHING else []
    return f"torch.ops.aten.{node.op}({', '.join(words)})"


def _named(key: str, arg: Arg) -> str:
    return f"torch.{arg}" if key in TORCH_NAMES and arg is not None else _argument(arg)


def _argument(arg: Arg) -> str:
    if isinstance(arg, tuple):
        return f"[{', '.join(map(_argument, arg))}]"
    if isinstance(arg, Mapping):
        return f"x{arg['ref']}" if "ref" in arg else "n" if arg["n"] == 1 else f"n * {arg['n']}"
    return f'float("{arg}")' if isinstance(arg, float) and arg - arg != 0.0 else repr(arg)
