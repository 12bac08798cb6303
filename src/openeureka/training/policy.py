"""A trained policy as a safetensors file: weights, observation statistics, and what is needed to run it anywhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from ..codec import decode
from ..errors import RewardFileError
from ..tasks.task import Recipe
from ..types.bounds import Count, Positive
from .heads import head
from .network import CRITIC, StackedActorCritic, normalize, shapes
from .ppo import PPO

FORMAT = "openeureka-policy-1"


@dataclass(frozen=True, slots=True)
class _Header:
    """What a file says of its tensors, see `Policy`."""

    format: Literal["openeureka-policy-1"]
    env: str
    choices: tuple[Positive, ...] = ()
    unseen: tuple[Count, ...] = ()
    interface: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Policy:
    """One lane's network with its observation normaliser.

    Tensors by name: `w0`, `b0`, ... trunk layers, `head_w`, `head_b` (actions, then the value), `log_std`,
    `observation_mean`, `observation_var`, `observation_count`, and the same of `value`. The action is the head's output
    clamped to [-1, 1]. With choices, which have no `log_std`, it has a one at each choice's option with the
    greatest output, and zeros elsewhere. Hidden layers are ELU. Inputs are (x - mean) / sqrt(var + 1e-5), clamped at
    +-5.
    """

    env: str
    tensors: Mapping[str, Tensor]
    choices: tuple[int, ...] = ()
    """Options of each choice; empty where actions are continuous."""
    unseen: tuple[int, ...] = ()
    """Columns of the observation that the actor does not see: their weights are 0. The critic then has its own trunk,
    under the same names with the prefix `critic_`."""
    interface: Mapping[str, str] = field(default_factory=dict)
    """What `tasks.deployment.described` says of the task that it was trained on, as text; may be empty."""

    @staticmethod
    def of(env: str, ppo: PPO, lane: int, interface: Mapping[str, str] | None = None) -> Policy:
        """A copy of one lane as it is now."""
        statistics = {name: tensor[lane].clone() for name, tensor in _statistics(ppo).items()}
        return Policy(env, ppo.network.lane(lane) | statistics, ppo.choices, ppo.network.unseen, interface or {})

    def untrained(self, seed: int, recipe: Recipe) -> Policy:
        """The policy that a training with this seed begins with, of the same sizes and with the same unseen columns."""
        recipe = replace(recipe, hidden=self.hidden)
        sizes, cpu = (self.observations, self.actions), torch.device("cpu")
        return Policy.of(self.env, PPO([seed], *sizes, recipe, cpu, self.choices, self.unseen), 0, self.interface)

    def put(self, ppo: PPO, lane: int, *, fresh: float = 0.0, rescaled: bool = False) -> None:
        """Let a lane continue from this policy: weights, exploration and all statistics; the optimiser begins anew.

        Weights may be mixed with fresh ones (shrink and perturb, arXiv 1910.08475). The log standard deviation is mixed
        with the recipe's in the same proportion: the more fresh weights a policy gets, the more it explores again. The
        value's output layer is kept, and so is a critic's own trunk: errors of the value would only mislead.

        Args:
            fresh: share of the weights that the lane was initialised with.
            rescaled: leave out the statistics of returns, because they are those of another reward.
        """
        own = ppo.network.lane(lane)
        mixed = {name: self.tensors[name].to(value).lerp(value, fresh) for name, value in own.items()}
        mixed |= {name: self.tensors[name].to(value) for name, value in own.items() if name.startswith(CRITIC)}
        for name in ("head_w", "head_b"):
            mixed[name][..., -1] = self.tensors[name][..., -1]
        ppo.network.load_lane(lane, mixed)
        for name, tensor in _statistics(ppo).items():
            if not (rescaled and name.startswith("value_")):
                tensor[lane] = self.tensors[name]

    def to_bytes(self) -> bytes:
        # One entry: safetensors writes several in no fixed order, and equal policies should be equal files.
        header = {"format": FORMAT, "env": self.env, "hidden": self.hidden, "activation": "elu"}
        header |= {"choices": self.choices} if self.choices else {}
        header |= {"unseen": self.unseen} if self.unseen else {}
        header |= {"interface": dict(self.interface)} if self.interface else {}
        tensors = {name: value.cpu().contiguous() for name, value in self.tensors.items()}
        return save(tensors, {"openeureka": json.dumps(header)})

    @staticmethod
    def from_bytes(data: bytes) -> Policy:
        """Raises RewardFileError for anything but a policy file of this format."""
        try:
            size = int.from_bytes(data[:8], "little")
            header = decode(_Header, json.loads(data[8 : 8 + size])["__metadata__"]["openeureka"])
            return Policy(header.env, load(data), header.choices, header.unseen, header.interface)
        except (SafetensorError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise RewardFileError(
                f"This is not a policy file of openeureka ({error!r:.80}); name one with policy=FILE."
            ) from None

    def expect(self, observations: int | None = None, actions: int | None = None) -> None:
        """Raises RewardFileError where the tensors do not form a network, or form one for a task of other sizes."""
        try:
            wanted = shapes(self.observations, self.actions, self.hidden, self.choices)
            wanted |= dict.fromkeys(("observation_mean", "observation_var"), (1, self.observations))
            found = {name: self.tensors[name] for name in wanted}
        except (KeyError, IndexError):
            raise RewardFileError(
                "The policy lacks parts of its network; train it again, or name another with policy=FILE."
            ) from None
        sizes = (observations or self.observations, actions or self.actions)
        whole = all(tuple(t.shape) == wanted[name] and t.is_floating_point() for name, t in found.items())
        split = not self.choices or sum(self.choices) == self.actions
        if (
            not whole
            or not split
            or any(column >= self.observations for column in self.unseen)
            or sizes != (self.observations, self.actions)
        ):
            raise RewardFileError(
                "The network of the policy does not fit this task; name the task that it was trained on with env=."
            )

    @property
    def hidden(self) -> tuple[int, ...]:
        count = sum(name[0] == "w" for name in self.tensors)
        return tuple(self.tensors[f"w{layer}"].shape[1] for layer in range(count))

    @property
    def observations(self) -> int:
        return self.tensors["w0"].shape[0]

    @property
    def actions(self) -> int:
        return self.tensors["head_b"].shape[-1] - 1  # without the value


def _statistics(ppo: PPO) -> dict[str, Tensor]:
    """The normalisers' tensors by their names in the file, each with a leading lane axis."""
    norms = {"observation": ppo.observations, "value": ppo.values}
    return {f"{name}_{part}": getattr(norm, part) for name, norm in norms.items() for part in ("mean", "var", "count")}


class Player:
    """Plays L policies of equal shape, each in its own lane of worlds.

    Args:
        noise: seed of action noise as in training, which is the same for every lane; None for actions without noise.
    """

    def __init__(self, policies: list[Policy], device: torch.device | str = "cpu", *, noise: int | None = None) -> None:
        first = policies[0]
        device = torch.device(device)
        sizes = (first.observations, first.actions, first.hidden)
        self.network = StackedActorCritic([0] * len(policies), *sizes, device, first.choices)
        self.head = head(first.choices)
        for lane, policy in enumerate(policies):
            self.network.load_lane(lane, policy.tensors)
        self.mean = torch.stack([policy.tensors["observation_mean"] for policy in policies]).to(device)
        self.var = torch.stack([policy.tensors["observation_var"] for policy in policies]).to(device)
        self._draws = None if noise is None else torch.Generator(device).manual_seed(noise)

    @torch.no_grad()
    def __call__(self, observation: Tensor) -> Tensor:
        """Actions (N, A), as a task takes them, for observations (N, O); N = L * n, lane by lane. Without noise they
        are the most likely ones."""
        x = observation.view(len(self.mean), -1, observation.shape[-1])
        output = self.network(normalize(x, self.mean, self.var)).mean
        if self._draws is None:
            return self.head.best(output).flatten(0, 1)
        noise = self.head.noise(output.shape[1:], self._draws)
        return self.head.sample(output, self.network.log_std, noise)[0].flatten(0, 1)
