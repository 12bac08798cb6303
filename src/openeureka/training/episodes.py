"""Recorded episodes of policies, thinned, and what other rewards would have paid in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from safetensors.torch import load, save
from torch import Tensor

from ..reward import graph as graphs
from ..tasks import registry
from ..tasks.task import State
from ..types import Episodes, RewardGraph, StateSpec

EPISODES = 16
"""Most episodes that are recorded of a policy."""
STEPS = 16
"""Most states that are kept of an episode; even."""
MAX_BYTES = 1 << 20
"""Most bytes for the states of one policy."""
TOGETHER = 2048
"""States that a program is given at once: about as many as a training has worlds, for which its memory was checked."""


class Recorder:
    """Keeps states of some worlds at evenly spaced steps.

    How long episodes last is not known beforehand: when there are too many states, every second one is dropped, and
    the spacing doubles. The last step of an episode is not kept specially: what a reward pays once at the end counts
    as little as any other step.

    Args:
        lanes: indices of the lanes of a simulation that are recorded.
        worlds: worlds per lane; the first ones are recorded.
    """

    def __init__(self, spec: StateSpec, lanes: Sequence[int], worlds: int) -> None:
        self._spec, self._lanes, self._count = spec, lanes, min(EPISODES, worlds)
        own = torch.arange(self._count)
        self._rows = torch.cat([own + lane * worlds for lane in lanes]) if lanes else own[:0]
        self._names = spec.per_world
        self._taken: list[tuple[Tensor, dict[str, Tensor]]] = []
        self._numbers: dict[str, Tensor] = {}
        self._apart, self._most = 1, 0

    def add(self, number: int, state: State, running: Tensor) -> None:
        """Record step `number`, counted from 0: its state, and which worlds (N,) were still in their episode."""
        if not self._lanes or number % self._apart:
            return
        if not self._most:
            self._begin(state, running.device)
        if len(self._taken) == self._most:
            self._taken, self._apart = self._taken[::2], 2 * self._apart
        self._taken.append((running[self._rows], {name: state[name][self._rows] for name in self._names}))

    def _begin(self, state: State, device: torch.device) -> None:
        self._rows = self._rows.to(device)
        size = sum(state[name][0].numel() * state[name].element_size() for name in self._names)
        affordable = MAX_BYTES // (self._count * max(1, size))
        self._most = max(2, min(STEPS, affordable) // 2 * 2)
        others = [variable.name for variable in self._spec.variables if variable.kind in ("constant", "float", "int")]
        # Constants may be views of one tensor, or transposed in memory: safetensors refuses to write either.
        own = {name: torch.as_tensor(state[name]).cpu() for name in others}
        self._numbers = {name: value.clone(memory_format=torch.contiguous_format) for name, value in own.items()}

    def read(self, sums: Sequence[Tensor]) -> Iterator[Episodes]:
        """What was recorded of each lane.

        Args:
            sums: for each recorded lane (3, n): value times weight, weight, and steps of each world.
        """
        if not self._taken:
            return
        running = torch.stack([mask for mask, _ in self._taken]).unflatten(1, (-1, self._count)).cpu()
        states = {
            name: torch.stack([state[name] for _, state in self._taken]).unflatten(1, (-1, self._count)).cpu()
            for name in self._names
        }
        for place, own in enumerate(sums):
            mask = running[:, place]
            kept = {name: value[:, place][mask].contiguous() for name, value in states.items()}
            value, weight, steps = own[:, : self._count].tolist()
            yield Episodes(
                fitness=tuple(v / w if w else None for v, w in zip(value, weight, strict=True)),
                steps=tuple(map(int, steps)),
                owners=tuple(mask.nonzero()[:, 1].tolist()),
                states=save(kept | self._numbers),
            )


def rewards(
    env: str, programs: Mapping[str, RewardGraph], episodes: Sequence[Episodes]
) -> Iterator[tuple[str, list[float]]]:
    """What each program pays in every recorded state, on the CPU; programs that fail or are not finite are left out."""
    spec = registry.get(env).spec
    parts = list(_parts(spec, [load(one.states) for one in episodes]))
    for name, graph in programs.items():
        try:
            program = graphs.CompiledReward(graph, spec)
            paid = torch.cat([program(state, count)[0] for count, state in parts])
        except (IndexError, RuntimeError):  # such as an index that no state of its check had
            continue
        if bool(torch.isfinite(paid).all()):
            yield name, paid.tolist()


def _parts(spec: StateSpec, recorded: Sequence[Mapping[str, Tensor]]) -> Iterator[tuple[int, dict[str, Any]]]:
    """All recorded states in batches, each with its number of states."""
    joined: dict[str, Any] = {}
    for variable in spec.variables:
        name = variable.name
        if variable.kind == "world":
            joined[name] = torch.cat([one[name] for one in recorded])
        elif variable.kind != "num_envs":
            value = recorded[0][name]  # belongs to the task: the same in every recording
            joined[name] = value if variable.kind == "constant" else value.item()
    worlds = spec.per_world
    for start in range(0, len(joined[worlds[0]]), TOGETHER):
        part = joined | {name: joined[name][start : start + TOGETHER] for name in worlds}
        count = len(part[worlds[0]])
        yield count, part | {variable.name: count for variable in spec.variables if variable.kind == "num_envs"}
