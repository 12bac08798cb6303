"""Many small operations launched as one: a function of tensors recorded as a CUDA graph and replayed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from ..reward.dispatch import Mode

Function = Callable[[Sequence[Tensor]], tuple[Tensor, ...]]

_WARM_UP = 3
_WAIT = {"_local_scalar_dense", "nonzero", "masked_select", "_unique2", "unique_dim", "equal", "is_nonzero"}
_INDEX = {"index", "index_put", "index_put_", "_index_put_impl_", "_unsafe_index"}


class Replay:
    """Calls a function: on a GPU as a recorded graph, elsewhere directly.

    The function must depend on its arguments alone, whose shapes stay as they are, and must not wait for the device
    (`waits`). Its results are fresh tensors.
    """

    def __init__(self, function: Function) -> None:
        self._function = function
        self._graph: torch.cuda.CUDAGraph | None = None
        self._inputs: list[Tensor] = []
        self._outputs: tuple[Tensor, ...] = ()

    def __call__(self, inputs: Sequence[Tensor]) -> tuple[Tensor, ...]:
        if not inputs or not inputs[0].is_cuda:
            return self._function(inputs)
        if self._graph is None:
            self._graph = self._record(inputs)
        for own, given in zip(self._inputs, inputs, strict=True):
            own.copy_(given)
        self._graph.replay()
        return tuple(output.clone() for output in self._outputs)

    def _record(self, inputs: Sequence[Tensor]) -> torch.cuda.CUDAGraph:
        self._inputs = [value.clone() for value in inputs]
        here, aside = torch.cuda.current_stream(), torch.cuda.Stream()
        aside.wait_stream(here)
        with torch.cuda.stream(aside):  # libraries initialise on first use, which no graph may hold
            for _ in range(_WARM_UP):
                self._function(self._inputs)
        here.wait_stream(aside)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph, capture_error_mode="thread_local"):
            self._outputs = self._function(self._inputs)
        return graph


def waits(function: Callable[[], object], *, uploads: bool = False) -> list[str]:
    """Operations of one call whose result's size or value the host must know before it can go on.

    On a GPU each is a stall and none can be recorded. Which they are does not depend on the device that `function`
    runs on.

    Args:
        uploads: also name what copies data to a GPU: tensors made from several Python numbers, and a number written at
            an index. `x[worlds] = 1.0` made the host wait on an H200. Write `x.index_fill_(0, worlds, 1.0)`.
    """
    with _Listener(uploads) as listener:
        function()
    return listener.heard


class _Listener(Mode):
    def __init__(self, uploads: bool) -> None:
        super().__init__()
        self.uploads = uploads
        self.heard: list[str] = []
        self._number: Tensor | None = None  # the last tensor made from a Python number

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        name = func.overloadpacket.__name__
        picks = name in _INDEX and any(_is_mask(index) for index in args[1])
        made = name == "lift_fresh"
        # A single number travels with the launch, unless it is written at an index.
        uploads = (made and args[0].dim() > 0) or (name in _INDEX and len(args) > 2 and args[2] is self._number)
        if name in _WAIT or picks or (self.uploads and uploads):
            self.heard.append(str(func))
        result = func(*args, **(kwargs or {}))
        self._number = result if made else self._number
        return result


def _is_mask(index: Tensor | None) -> bool:
    return index is not None and index.dtype in (torch.bool, torch.uint8)
