"""Watches a reward program run: `Guard` stops it at the first forbidden operation, `Tracer` records the operations."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeGuard, cast

import torch
from torch import Tensor
from torch.func import functionalize
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import _disable_current_modes  # pyright: ignore[reportPrivateUsage]

from ..types import Arg, Finding, Node, Part, RewardGraph
from . import surface
from .dispatch import Mode
from .gate import FILENAME
from .validate import MAX_CONSTANT, IntegerDivision, references, refuse_truncation

MAX_OPERATIONS = 20_000
"""Operations of one run, including those that no output needs."""

_READS = surface.words("""
    equal nonzero nonzero_static masked_select _unique _unique2 unique_dim unique_consecutive bincount
""")
_READS_A_NUMBER = "_local_scalar_dense"
"""`float()`, `if` and torch itself call it. It is fine on numbers not from the state, of which `Tracer` keeps track."""
_SELECTS = "index.Tensor"
_MASKED = (_SELECTS, "index_put.default")
_LEFT, _RIGHT = ("<<", "write `a * 2**b`"), (">>", "write `a // 2**b`")
_SPELT = {
    "__lshift__": _LEFT,
    "bitwise_left_shift": _LEFT,
    "__rshift__": _RIGHT,
    "bitwise_right_shift": _RIGHT,
    "empty": ("torch.Tensor(n)", "use `torch.zeros(n)`, or `torch.tensor([...])` for numbers"),
}
"""What an author wrote where torch ran an operation of another name, and what to write instead."""


def _type_as(tensor: Tensor, other: Tensor) -> Tensor:
    return tensor.to(other.dtype)  # the tensor itself where it has that dtype


_PURE: Mapping[object, Callable[..., Tensor]] = {
    Tensor.type_as: _type_as,
    Tensor.__iand__: Tensor.bitwise_and_,
    Tensor.__ior__: Tensor.bitwise_or_,
    Tensor.__ixor__: Tensor.bitwise_xor_,
    Tensor.__ilshift__: Tensor.bitwise_left_shift_,
    Tensor.__irshift__: Tensor.bitwise_right_shift_,
    Tensor.clip_: Tensor.clamp_,
    Tensor.square_: partial(Tensor.pow_, exponent=2),
}
_UNUSED_KWARGS = surface.words("device layout pin_memory non_blocking")
_SAME_VALUE = surface.words("lift_fresh.default detach.default alias.default")


class Refused(Exception):
    """Ends a probe with a finding."""

    def __init__(self, rule: str, message: str, fix: str = "", line: int | None = None) -> None:
        super().__init__(message)
        self.finding = Finding(rule=rule, message=message, fix=fix, line=line)


def branch(line: int | None) -> Refused:
    """The refusal of Python code that looks at a tensor's values."""
    return Refused(
        "branch",
        "Python reads a value out of a tensor here (`if`, `and`, `max()`, `float()`, `math.` or the like), so one "
        "decision would hold for all worlds",
        "use torch.where(condition, a, b), masks, torch.minimum and torch functions on whole tensors",
        line,
    )


def current_line() -> int | None:
    """Line of the program that is running."""
    frame = inspect.currentframe()
    while frame is not None:
        if frame.f_code.co_filename == FILENAME:
            return frame.f_lineno
        frame = frame.f_back
    return None


class Guard(Mode):
    """Refuses random numbers, selections by value and writes into the inputs."""

    def __init__(self, inputs: Mapping[str, Tensor]) -> None:
        super().__init__()
        self._owner = {tensor.untyped_storage().data_ptr(): name for name, tensor in inputs.items()}
        self.refusal: Refused | None = None
        """The first refusal; kept because a program could catch the exception."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        try:
            _judge(func, args, kwargs)
            if func._schema.is_mutable:
                self._judge_write(func, args, kwargs)
        except Refused as refusal:
            self.refusal = self.refusal or refusal
            raise
        return func(*args, **kwargs)

    def _judge_write(self, func: Any, args: Sequence[Any], kwargs: Mapping[str, Any]) -> None:
        for index, argument in enumerate(func._schema.arguments):
            if argument.alias_info is None or not argument.alias_info.is_write:
                continue
            value = args[index] if index < len(args) else kwargs.get(argument.name)
            tensors = cast(Sequence[object], value) if isinstance(value, list | tuple) else (value,)
            for tensor in tensors:
                name = self._input_of(tensor)
                if name is not None:
                    message = f"in-place edit of input `{name}`"
                    raise Refused("input-edit", message, f"copy it first: `x = {name}.clone()`", current_line())

    def _input_of(self, value: object) -> str | None:
        return self._owner.get(value.untyped_storage().data_ptr()) if isinstance(value, Tensor) else None


def _judge(func: Any, args: Sequence[Any], kwargs: Mapping[str, Any]) -> None:
    name = func._overloadpacket.__name__
    if kwargs.get("rounding_mode") == "trunc":
        try:
            refuse_truncation(args[0], args[1], "trunc")
        except IntegerDivision as error:
            fix = "write `a // b`, which rounds down, or divide floats"
            raise Refused("integer-division", f"{error}: it may end the process", fix, current_line()) from None
    if torch.Tag.nondeterministic_seeded in func.tags:
        message = f"`{name}` is random, and a reward must give the same value for the same state"
        raise Refused("randomness", message, "remove it", current_line())
    if name in _READS:
        raise branch(current_line())


class Tracer(Mode):
    """Records every operation below autograd as a graph node.

    Args:
        worlds: N. A boolean mask with an axis of this length counts as one that picks worlds.
        every: make each such mask pick all (True) or nothing (False), whatever its values; None leaves masks alone.
    """

    def __init__(self, worlds: int, every: bool | None = None) -> None:
        super().__init__()
        self._worlds, self._every = worlds, every
        self.nodes: list[Node] = []
        self.lines: list[int | None] = []
        self.selections: list[int] = []
        """Nodes that hold the elements which a mask picks."""
        self._of_state: set[int] = set()
        """Nodes whose values come from the inputs."""
        self._index: dict[int, int] = {}
        self._alive: list[Tensor] = []  # an id is only unique while its object lives

    def add(self, op: str, args: tuple[Arg, ...], kwargs: Mapping[str, Arg] | None = None) -> int:
        if len(self.nodes) >= MAX_OPERATIONS:
            raise Refused("memory", "the program runs too many operations", "use fewer, larger tensors", current_line())
        node, index = Node(op, args, kwargs or {}), len(self.nodes)
        if op == "input" or not self._of_state.isdisjoint(references(node)):
            self._of_state.add(index)
        self.nodes.append(node)
        self.lines.append(current_line())
        return index

    def name(self, tensor: Tensor, index: int) -> None:
        self._index[id(tensor)] = index
        self._alive.append(tensor)

    def index(self, value: Tensor | float) -> int:
        """The node that holds a value; a tensor that no operation made becomes a constant."""
        if not isinstance(value, Tensor):
            return self.add("full.default", ((), float(value)))
        known = self._index.get(id(value))
        return self._constant(value) if known is None else known

    def _constant(self, tensor: Tensor) -> int:
        if tensor.numel() > MAX_CONSTANT:
            raise Refused("memory", "a literal tensor is too large", "build it with torch operations", current_line())
        # The mode is not active inside its own handler, but `index` is also called from outside of it.
        with _disable_current_modes():
            flat = tensor.detach().reshape(-1)
            numbers = cast(tuple[float, ...], tuple(flat.tolist()))  # pyright: ignore[reportUnknownMemberType, reportUnknownArgumentType]
        index = self.add("constant", (numbers, tuple(tensor.shape), str(tensor.dtype).removeprefix("torch.")))
        self.name(tensor, index)
        return index

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        _judge(func, args, kwargs)
        op = str(func).removeprefix("aten.")
        if op.startswith(_READS_A_NUMBER):
            if self.index(args[0]) in self._of_state:
                raise branch(current_line())
            return func(*args, **kwargs)
        if op in _SAME_VALUE:
            result = func(*args, **kwargs)
            self.name(result, self.index(args[0]))
            return result
        if op in _MASKED:
            args = (args[0], self._numbered(args[1]), *args[2:])
        op, written = _written(op, args)
        if op not in surface.ATEN:
            spelt, fix = _SPELT.get(op.partition(".")[0], (op, "write it with simpler tensor operations"))
            raise Refused("operation", f"the operation `{spelt}` cannot be part of a reward", fix, current_line())
        kept = {key: self._encode(value) for key, value in kwargs.items() if key not in _UNUSED_KWARGS}
        index = self.add(op, tuple(self._encode(arg) for arg in written), kept)
        if op in _MASKED:
            args = (args[0], self._picking(op, index, args[1]), *args[2:])
        result = func(*args, **kwargs)
        if isinstance(result, Tensor):
            self.name(result, index)
        else:
            for position, part in enumerate(result):
                self.name(part, self.add("getitem", ({"ref": index}, position)))
        return result

    def _numbered(self, indices: Sequence[Tensor | None]) -> Sequence[Tensor | None]:
        """The indices, with constant masks replaced by the places that they pick.

        The shape of what they pick is then known before any number is computed. A mask over worlds stays a mask, since
        a list of places would hold for one number of worlds.
        """
        numbered: list[Tensor | None] = []
        for index in indices:
            if index is None or index.dtype != torch.bool or not index.dim() or not self._is_constant(index):
                numbered.append(index)
                continue
            with _disable_current_modes():
                numbered += [place.clone() for place in index.nonzero().unbind(-1)]
        return numbered

    def _is_constant(self, mask: Tensor) -> bool:
        small = mask.numel() <= MAX_CONSTANT and self._worlds not in mask.shape
        return small and self.index(mask) not in self._of_state

    def _picking(self, op: str, node: int, indices: Sequence[Tensor | None]) -> Sequence[Tensor | None]:
        """The indices, with masks over worlds replaced as `every` says."""
        if op == _SELECTS and any(map(self._is_mask, indices)):
            self.selections.append(node)
        every = self._every
        if every is None:
            return indices
        return [torch.full_like(index, every) if self._is_mask(index) else index for index in indices]

    def _is_mask(self, index: Tensor | None) -> TypeGuard[Tensor]:
        """Whether an index is a mask over worlds that depends on the state. What constants pick never changes."""
        return (
            index is not None
            and index.dtype == torch.bool
            and self._worlds in index.shape
            and self.index(index) in self._of_state
        )

    def _encode(self, value: object) -> Arg:
        if isinstance(value, list | tuple):
            return tuple(self._encode_part(part) for part in cast(Sequence[object], value))
        return self._encode_part(value)

    def _encode_part(self, value: object) -> Part:
        if isinstance(value, Tensor):
            return {"ref": self.index(value)}
        if isinstance(value, torch.dtype | torch.memory_format):
            return str(value).removeprefix("torch.")
        if value is None or isinstance(value, bool | int | float | str):
            return value
        raise Refused(
            "operation", f"an argument of type {type(value).__name__} cannot be part of a reward", "", current_line()
        )


def _written(op: str, args: Sequence[Any]) -> tuple[str, Sequence[Any]]:
    """The operation and the arguments that a graph holds for one that torch ran."""
    if op.startswith(("squeeze.", "squeeze_.")):  # matmul drops a dimension of its own result in place
        return "squeeze.dims", (args[0], _dropped(*args))
    if op == "_reshape_alias.default":  # its strides are unchecked: forged ones read any memory
        return "reshape.default", args[:2]
    if op == "zero.default":  # a functionalised `zero_`, which torch offers in place only
        return "zeros_like.default", args
    return op, args


def _dropped(tensor: Tensor, given: int | Sequence[int] | None = None) -> tuple[int, ...]:
    """The dimensions that a squeeze drops, by number, so that a single world keeps its world axis."""
    dims = range(tensor.dim()) if given is None else [given] if isinstance(given, int) else given
    return tuple(dim for dim in dims if tensor.dim() and tensor.shape[dim] == 1)


class _Pure(TorchFunctionMode):
    """Replaces methods that torch cannot functionalise by equivalent ones that it can."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _PURE.get(func, func)(*args, **(kwargs or {}))


Outputs = tuple[Tensor, Mapping[str, Tensor | float]]


def trace(tracer: Tracer, run: Callable[[Mapping[str, Tensor]], Outputs], inputs: Mapping[str, Tensor]) -> RewardGraph:
    """The operations of one run as a graph for the run's number of worlds.

    In-place edits of tensors that the program made become pure operations (functionalisation).
    """
    for name, tensor in inputs.items():
        tracer.name(tensor, tracer.add("input", (name,)))
    numbers: dict[str, float] = {}
    order: list[str] = []

    def flat(*tensors: Tensor) -> list[Tensor]:
        reward, components = run(dict(zip(inputs, tensors, strict=True)))
        order.extend(components)
        numbers.update({name: value for name, value in components.items() if not isinstance(value, Tensor)})
        return [reward, *(value for value in components.values() if isinstance(value, Tensor))]

    with torch.no_grad(), tracer, _Pure():
        reward, *rest = functionalize(flat, remove="mutations")(*inputs.values())
    tensors = iter(rest)
    components = tuple((name, tracer.index(numbers[name] if name in numbers else next(tensors))) for name in order)
    return RewardGraph(nodes=tuple(tracer.nodes), reward=tracer.index(reward), components=components)
