"""L actor-critic networks stacked into one, and the normalisers of their inputs and values.

Every tensor has a leading lane axis, and every layer is one batched product.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

EPSILON = 1e-5
LIMIT = 5.0
ALL = slice(None)
"""All lanes."""


class RunningNorm:
    """Normalises the last axis by the running mean and variance of all that a lane has seen, separately for each lane.

    Statistics start as those of one sample with mean 0 and variance 1 (rl_games' convention).

    Args:
        lanes, size: L and the size D of the last axis.
    """

    def __init__(self, lanes: int, size: int, device: torch.device) -> None:
        self.mean = torch.zeros(lanes, 1, size, device=device)
        self.var = torch.ones(lanes, 1, size, device=device)
        self.count = torch.ones(lanes, 1, 1, device=device)

    def update(self, x: Tensor) -> None:
        """Add x (L, B, D) to the statistics, by the parallel formula of Chan, Golub and LeVeque (1979)."""
        batch = x.shape[1]
        mean = x.mean(1, keepdim=True)
        var = (x - mean).square_().mean(1, keepdim=True)  # four times as fast as torch.var_mean on a CPU
        total = self.count + batch
        delta = mean - self.mean
        self.mean = self.mean + delta * (batch / total)
        self.var = (self.var * self.count + var * batch + delta**2 * (self.count * batch / total)) / total
        self.count = total

    def state_dict(self, lanes: slice = ALL) -> dict[str, Any]:
        """Statistics of these lanes, copied."""
        state = {"mean": self.mean, "var": self.var, "count": self.count}
        return {name: value[lanes].clone() for name, value in state.items()}

    def load_state_dict(self, saved: Mapping[str, Any]) -> None:
        self.mean, self.var, self.count = saved["mean"], saved["var"], saved["count"]

    def normalize(self, x: Tensor, lanes: slice = ALL) -> Tensor:
        """Normalise x (L, B, D) of these lanes to zero mean and unit variance, clamped at +-5."""
        return normalize(x, self.mean[lanes], self.var[lanes])

    def denormalize(self, x: Tensor, lanes: slice = ALL) -> Tensor:
        """Back to the original scale (clamped at +-5 standard deviations)."""
        return x.clamp(-LIMIT, LIMIT) * torch.sqrt(self.var[lanes] + EPSILON) + self.mean[lanes]


def normalize(x: Tensor, mean: Tensor, var: Tensor) -> Tensor:
    """x in standard deviations from its mean, clamped at +-5."""
    # In place: a whole rollout of observations is too large for the allocator to keep, and new memory is slow.
    return (x - mean).mul_(torch.rsqrt(var + EPSILON)).clamp_(-LIMIT, LIMIT)


CRITIC = "critic_"
"""Prefix of the names of parameters that only the critic uses."""


class Output(NamedTuple):
    """What the networks of L lanes make of B observations each."""

    mean: Tensor
    """(L, B, A) action means."""
    value: Tensor
    """(L, B) state values, in units of the value normaliser."""


class StackedActorCritic:
    """A shared ELU trunk with linear heads for action mean and value, and a free log standard deviation, per lane.

    Where actions are `choices`, the means are preferences, and there is no standard deviation.

    All parameters are views of `flat` (L, P), so that an optimiser and a checkpoint are single tensor operations. Lanes
    of equal seed start from equal weights: PyTorch's default linear initialisation, scaled by `head` for the action
    means, with biases 0 and standard deviation `noise`.

    The actor does not see the `unseen` columns of the observation: their weights are 0 and stay 0. The critic then has
    its own trunk of the same size, which sees them (asymmetric actor-critic, arXiv 1710.06542).
    """

    def __init__(
        self,
        seeds: Sequence[int],
        observations: int,
        actions: int,
        hidden: Sequence[int],
        device: torch.device,
        choices: Sequence[int] = (),
        noise: float = 1.0,
        head: float = 1.0,
        unseen: Sequence[int] = (),
    ) -> None:
        self.lanes, self.actions = len(seeds), actions
        self.sizes = (observations, *hidden)
        own = shapes(observations, actions, hidden, choices)
        self.unseen = tuple(unseen)
        if unseen:
            own |= {f"{CRITIC}{name}": shape for name, shape in shapes(observations, 0, hidden, [1]).items()}
            self._seen = torch.ones(observations, device=device)
            self._seen[list(unseen)] = 0.0
        initial = {seed: _initial(own, seed) for seed in set(seeds)}
        self.flat = torch.stack([initial[seed] for seed in seeds]).to(device)
        self.parameters: dict[str, Tensor] = {}
        offset = 0
        for name, shape in own.items():
            size = math.prod(shape)
            view = self.flat[:, offset : offset + size].view(self.lanes, *shape)
            self.parameters[name] = view.detach().requires_grad_()
            offset += size
        self.log_std.detach().fill_(math.log(noise))
        self.parameters["head_w"].detach()[..., :actions] *= head
        if unseen:
            self.parameters["w0"].detach()[:, list(unseen)] = 0.0

    def __call__(self, x: Tensor, lanes: slice = ALL) -> Output:
        """Evaluate normalised observations (L, B, O) of these lanes."""
        if not self.unseen:
            heads = self._heads(x, lanes)
            return Output(heads[..., : self.actions], heads[..., self.actions])
        heads = self._heads(x * self._seen, lanes)
        return Output(heads[..., : self.actions], self._heads(x, lanes, CRITIC)[..., 0])

    def _heads(self, x: Tensor, lanes: slice, whose: str = "") -> Tensor:
        p = self.parameters
        for layer in range(len(self.sizes) - 1):
            weight, bias = p[f"{whose}w{layer}"][lanes], p[f"{whose}b{layer}"][lanes]
            # In place, because then the gradient comes from the result and needs no second exponential.
            x = functional.elu(torch.baddbmm(bias, x, weight), inplace=True)
        return torch.baddbmm(p[f"{whose}head_b"][lanes], x, p[f"{whose}head_w"][lanes])

    @property
    def log_std(self) -> Tensor:
        """(L, 1, A), or (L, 1, 0) for choices."""
        return self.parameters["log_std"] if "log_std" in self.parameters else self.flat.new_zeros(self.lanes, 1, 0)

    def lane(self, index: int) -> dict[str, Tensor]:
        """A copy of one lane's parameters."""
        return {name: value[index].detach().clone() for name, value in self.parameters.items()}

    def load_lane(self, index: int, parameters: Mapping[str, Tensor]) -> None:
        with torch.no_grad():
            for name, value in self.parameters.items():
                value[index] = parameters[name]


def shapes(
    observations: int, actions: int, hidden: Sequence[int], choices: Sequence[int] = ()
) -> dict[str, tuple[int, ...]]:
    sizes = (observations, *hidden)
    found: dict[str, tuple[int, ...]] = {}
    for layer, (inputs, outputs) in enumerate(pairwise(sizes)):
        found |= {f"w{layer}": (inputs, outputs), f"b{layer}": (1, outputs)}
    found |= {"head_w": (sizes[-1], actions + 1), "head_b": (1, actions + 1)}
    return found if choices else found | {"log_std": (1, actions)}


def _initial(parameters: Mapping[str, tuple[int, ...]], seed: int) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    parts = []
    for name, shape in parameters.items():
        if "w" in name:
            bound = 1.0 / math.sqrt(shape[0])
            parts.append(torch.empty(math.prod(shape)).uniform_(-bound, bound, generator=generator))
        else:
            parts.append(torch.zeros(math.prod(shape)))
    return torch.cat(parts)
