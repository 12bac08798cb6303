"""What the outputs of a policy mean: the means of Gaussian actions, or preferences among the options of choices."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import torch
from torch import Tensor

from ..tasks.choices import chosen

BOUND = 1.1  # action means beyond this are pulled back
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


class Head(ABC):
    """A distribution over actions (L, B, A), given the outputs of L policies for B observations and their `log_std`."""

    @abstractmethod
    def noise(self, shape: Sequence[int], generator: torch.Generator) -> Tensor:
        """Random numbers for `sample` from one seed, of the shape (B, A) of the outputs."""

    @abstractmethod
    def sample(self, output: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Actions (L, B, A) and the logarithms of their probabilities (L, B)."""

    @abstractmethod
    def log_prob(self, output: Tensor, log_std: Tensor, action: Tensor) -> Tensor:
        """Log probabilities (L, B) of actions."""

    @abstractmethod
    def divergence(self, output: Tensor, log_std: Tensor, old: Tensor, old_log_std: Tensor) -> Tensor:
        """KL(new || old), averaged over samples: (L, 1)."""

    @abstractmethod
    def entropy(self, output: Tensor, log_std: Tensor) -> Tensor:
        """Entropy (L,) [nats], averaged over samples."""

    @abstractmethod
    def excess(self, output: Tensor) -> Tensor:
        """How far outputs lie outside of the range of actions, squared: (L, B)."""

    @abstractmethod
    def best(self, output: Tensor) -> Tensor:
        """The most likely actions, as a task takes them."""


class Gaussian(Head):
    """A diagonal Gaussian over actions; the task clamps them to [-1, 1]."""

    def noise(self, shape: Sequence[int], generator: torch.Generator) -> Tensor:
        return torch.randn(shape, generator=generator, device=generator.device)

    def sample(self, output: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        log_prob = -(0.5 * noise**2 + log_std + _HALF_LOG_2PI).sum(-1)
        return output + log_std.exp() * noise, log_prob

    def log_prob(self, output: Tensor, log_std: Tensor, action: Tensor) -> Tensor:
        z = (action - output) * (-log_std).exp()
        return -(0.5 * z**2 + log_std + _HALF_LOG_2PI).sum(-1)

    def divergence(self, output: Tensor, log_std: Tensor, old: Tensor, old_log_std: Tensor) -> Tensor:
        variance, old_variance = (2.0 * log_std).exp(), (2.0 * old_log_std).exp()
        ratio = (variance + (output - old) ** 2) / (2.0 * old_variance)
        return (old_log_std - log_std + ratio - 0.5).sum(-1).mean(1, keepdim=True)

    def entropy(self, output: Tensor, log_std: Tensor) -> Tensor:
        return log_std.sum((1, 2)) + log_std.shape[2] * (0.5 + _HALF_LOG_2PI)

    def excess(self, output: Tensor) -> Tensor:
        return ((output.abs() - BOUND).clamp(min=0.0) ** 2).sum(-1)

    def best(self, output: Tensor) -> Tensor:
        return output.clamp(-1.0, 1.0)


class Categorical(Head):
    """One option of each choice, with the softmax of its preferences as probabilities; log_std is empty.

    Args:
        choices: options of each choice; A is their sum.
    """

    def __init__(self, choices: Sequence[int]) -> None:
        self.choices = tuple(choices)

    def noise(self, shape: Sequence[int], generator: torch.Generator) -> Tensor:
        uniform = torch.rand(shape, generator=generator, device=generator.device)
        tiny = torch.finfo(uniform.dtype).tiny
        return -(-uniform.clamp(min=tiny).log()).clamp(min=tiny).log()  # Gumbel: the argmax of the sum is a sample

    def sample(self, output: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        action = chosen(output + noise, self.choices)
        return action, self.log_prob(output, log_std, action)

    def log_prob(self, output: Tensor, log_std: Tensor, action: Tensor) -> Tensor:
        return (self._log_softmax(output) * action).sum(-1)

    def divergence(self, output: Tensor, log_std: Tensor, old: Tensor, old_log_std: Tensor) -> Tensor:
        new = self._log_softmax(output)
        return (new.exp() * (new - self._log_softmax(old))).sum(-1).mean(1, keepdim=True)

    def entropy(self, output: Tensor, log_std: Tensor) -> Tensor:
        new = self._log_softmax(output)
        return -(new.exp() * new).sum(-1).mean(1)

    def excess(self, output: Tensor) -> Tensor:
        return output.new_zeros(output.shape[:-1])

    def best(self, output: Tensor) -> Tensor:
        return chosen(output, self.choices)

    def _log_softmax(self, output: Tensor) -> Tensor:
        parts = output.split(list(self.choices), dim=-1)
        return torch.cat([part.log_softmax(-1) for part in parts], dim=-1)


def head(choices: Sequence[int]) -> Head:
    """The head of a task with these choices, or with continuous actions where there are none."""
    return Categorical(choices) if choices else Gaussian()
