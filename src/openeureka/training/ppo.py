"""Proximal policy optimisation of L lanes at once (Schulman et al., arXiv 1707.06347, with rl_games' details)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import torch
from torch import Tensor

from ..tasks.task import Recipe
from .heads import head
from .network import ALL, RunningNorm, StackedActorCritic
from .pausing import joined

LEARNING_RATES = (1e-6, 1e-2)
STATISTICS = ("surrogate_loss", "value_loss", "kl", "entropy", "learning_rate")
"""Columns of `PPO.statistics`."""


class Action(NamedTuple):
    """What the policies of L lanes chose, in n worlds each."""

    action: Tensor
    """(L, n, A), not clamped; for choices, ones and zeros."""
    log_prob: Tensor
    """(L, n)."""
    mean: Tensor
    """(L, n, A); for choices, the preferences."""
    value: Tensor
    """(L, n) in reward units."""


class Rollout:
    """What L lanes of n worlds did in T steps, world-major so that a slice of worlds is a contiguous minibatch."""

    def __init__(
        self, lanes: int, worlds: int, horizon: int, observations: int, actions: int, device: torch.device
    ) -> None:
        def empty(*sizes: int) -> Tensor:
            return torch.zeros(lanes, worlds, horizon, *sizes, device=device)

        self.observation, self.action, self.mean = empty(observations), empty(actions), empty(actions)
        self.log_prob, self.value, self.reward, self.done = empty(), empty(), empty(), empty()

    def store(self, t: int, observation: Tensor, step: Action, reward: Tensor, done: Tensor) -> None:
        """Keep step t: the raw observation (L, n, O) acted on, and what came of it; reward and done are (L, n)."""
        self.observation[:, :, t], self.action[:, :, t], self.mean[:, :, t] = observation, step.action, step.mean
        self.log_prob[:, :, t], self.value[:, :, t] = step.log_prob, step.value
        self.reward[:, :, t], self.done[:, :, t] = reward, done


def advantages(rollout: Rollout, last_value: Tensor, gamma: float, lam: float) -> Tensor:
    """Generalised advantage estimates (L, n, T) (arXiv 1506.02438).

    A done step ends its episode. The value of what follows a time-out must already be in its reward.

    Args:
        last_value: (L, n) value of the observation after the last step.
    """
    result = torch.empty_like(rollout.reward)
    running = torch.zeros_like(last_value)
    following = last_value
    for t in reversed(range(rollout.reward.shape[2])):
        alive = 1.0 - rollout.done[:, :, t]
        delta = rollout.reward[:, :, t] + gamma * following * alive - rollout.value[:, :, t]
        running = delta + gamma * lam * alive * running
        result[:, :, t] = running
        following = rollout.value[:, :, t]
    return result


class PPO:
    """Policies, normalisers and optimiser of L lanes; knows no environment.

    Lanes share every kernel and nothing else: gradients, gradient norms, learning rates and statistics are per lane, so
    that a lane learns what it would learn alone. A lane whose `active` is False is frozen.

    Args:
        choices: options of each choice where actions are discrete; `actions` is then their sum.
        unseen: columns of the observation that only the critic sees.

    Attributes:
        statistics: (L, 5), a column for each of `STATISTICS`, of the last update. Losses and KL are means over gradient
            steps; the KL is that since the minibatch was last seen. Entropy [nats] and learning rate are those at its
            end. NaN for frozen lanes.
    """

    def __init__(
        self,
        seeds: Sequence[int],
        observations: int,
        actions: int,
        recipe: Recipe,
        device: torch.device,
        choices: Sequence[int] = (),
        unseen: Sequence[int] = (),
    ) -> None:
        self.recipe, self.device, self.choices = recipe, device, tuple(choices)
        self.head = head(choices)
        lanes = len(seeds)
        self.network = StackedActorCritic(
            seeds, observations, actions, recipe.hidden, device, choices, recipe.noise, recipe.head, unseen
        )
        self.observations = RunningNorm(lanes, observations, device)
        self.values = RunningNorm(lanes, 1, device)
        self.active = torch.ones(lanes, dtype=torch.bool, device=device)
        self.learning_rate = torch.full((lanes, 1), recipe.learning_rate, device=device)
        self._first = torch.zeros_like(self.network.flat)
        self._second = torch.zeros_like(self.network.flat)
        self._updates = 0
        self.statistics = torch.full((lanes, len(STATISTICS)), math.nan, device=device)
        # Lanes of equal seed share their noise: candidates are compared under the same exploration.
        distinct = sorted(set(seeds))
        self._row = torch.tensor([distinct.index(seed) for seed in seeds], device=device)
        self._generators = [torch.Generator(device).manual_seed(seed + 1) for seed in distinct]

    @torch.no_grad()
    def act(self, observation: Tensor) -> Action:
        """Sample actions for observations (L, n, O)."""
        mean, value = self.network(self.observations.normalize(observation))
        log_std = self.network.log_std
        noise = torch.stack([self.head.noise(mean.shape[1:], generator) for generator in self._generators])
        action, log_prob = self.head.sample(mean, log_std, noise[self._row])
        return Action(action, log_prob, mean, self._value(value))

    @torch.no_grad()
    def value(self, observation: Tensor, lanes: slice = ALL) -> Tensor:
        """(L, n) state values in reward units of observations (L, n, O) of these lanes."""
        output = self.network(self.observations.normalize(observation, lanes), lanes)
        return self._value(output.value, lanes)

    def value_where(self, observation: Tensor, where: Tensor) -> Tensor:
        """`value` in the worlds where `where` (L, n) is true, 0 in the others; the host waits to learn which those are.

        One lane at a time: in one product, the number of worlds of one lane would change how those of others round.
        """
        values = torch.zeros(where.shape, device=self.device)
        for lane in where.any(1).nonzero().flatten().tolist():
            chosen = where[lane]
            values[lane, chosen] = self.value(observation[lane, chosen][None], slice(lane, lane + 1))[0]
        return values

    def _value(self, normalised: Tensor, lanes: slice = ALL) -> Tensor:
        return self.values.denormalize(normalised[..., None], lanes)[..., 0]

    def update(self, rollout: Rollout, last_value: Tensor) -> None:
        """One PPO epoch on a rollout; `last_value` (L, n) is the value after its last step."""
        recipe = self.recipe
        advantage = advantages(rollout, last_value, recipe.gamma, recipe.gae_lambda)
        returns = advantage + rollout.value
        lanes, worlds, horizon = advantage.shape
        self.values.update(returns.reshape(lanes, -1, 1))
        spread, centre = torch.std_mean(advantage, dim=(1, 2), keepdim=True)
        advantage = (advantage - centre) / (spread + 1e-8)
        target, old_value = (self.values.normalize(v.reshape(lanes, -1, 1))[..., 0] for v in (returns, rollout.value))

        size = worlds * horizon
        raw, actions, means = (v.flatten(1, 2) for v in (rollout.observation, rollout.action, rollout.mean))
        # The normaliser is updated at the end: the whole update sees observations as the acting policy saw them.
        observations = self.observations.normalize(raw)
        log_prob, advantage = rollout.log_prob.flatten(1), advantage.flatten(1)
        edges = [round(i * size / recipe.minibatches) for i in range(recipe.minibatches + 1)]
        slices = [slice(a, b) for a, b in pairwise(edges)]
        old_std = [self.network.log_std.detach().clone() for _ in slices]
        told: list[Tensor] = []
        for _ in range(recipe.epochs):
            for index, part in enumerate(slices):
                old = (means[:, part], old_std[index], log_prob[:, part], old_value[:, part])
                means[:, part], old_std[index], of_step = self._step(
                    observations[:, part], actions[:, part], old, advantage[:, part], target[:, part]
                )
                told.append(of_step)
        self.observations.update(raw)
        self._tell(told, means)

    @torch.no_grad()
    def _tell(self, steps: Sequence[Tensor], means: Tensor) -> None:
        """Set `statistics` from those of each gradient step, (L, 3), and the outputs (L, B, A) of the last epoch; all
        of it stays on the device."""
        entropy = self.head.entropy(means, self.network.log_std)
        told = torch.cat((torch.stack(list(steps)).mean(0), entropy[:, None], self.learning_rate), dim=1)
        self.statistics = told.masked_fill(~self.active[:, None], math.nan)

    def lane_state(self, lane: int) -> dict[str, Any]:
        """All that a lane's next update depends on, copied."""
        own = slice(lane, lane + 1)
        return {
            "network": self.network.flat[own].clone(),
            "observations": self.observations.state_dict(own),
            "values": self.values.state_dict(own),
            "active": self.active[own].clone(),
            "learning_rate": self.learning_rate[own].clone(),
            "moments": (self._first[own].clone(), self._second[own].clone()),
            "updates": self._updates,
            "generators": [self._generators[int(self._row[lane])].get_state()],
        }

    def load_lanes(self, lanes: Sequence[dict[str, Any]]) -> None:
        """Restore, in a new PPO, lanes of the same seeds, sizes and recipe, all after equally many updates."""
        saved = joined(lanes)
        self.network.flat.copy_(saved["network"])  # in place: all parameters are views of it
        self.observations.load_state_dict(saved["observations"])
        self.values.load_state_dict(saved["values"])
        self.active, self.learning_rate = saved["active"], saved["learning_rate"]
        self._first, self._second = saved["moments"]
        self._updates = saved["updates"]
        for row, state in zip(self._row.tolist(), saved["generators"], strict=True):
            self._generators[row].set_state(state.cpu())

    def _step(
        self, observation: Tensor, action: Tensor, old: tuple[Tensor, ...], advantage: Tensor, target: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One gradient step on a minibatch; returns the means and log std that the divergence was measured with, and
        (L, 3) surrogate loss, value loss and divergence."""
        recipe = self.recipe
        old_mean, old_log_std, old_log_prob, old_value = old
        mean, value = self.network(observation)
        log_std = self.network.log_std
        log_prob = self.head.log_prob(mean, log_std, action)
        ratio = (log_prob - old_log_prob).exp()
        clipped = ratio.clamp(1.0 - recipe.clip, 1.0 + recipe.clip)
        policy_loss = torch.maximum(-advantage * ratio, -advantage * clipped)
        near = old_value + (value - old_value).clamp(-recipe.clip, recipe.clip)
        value_loss = torch.maximum((value - target) ** 2, (near - target) ** 2)
        bounds_loss = self.head.excess(mean)
        loss = (policy_loss + 0.5 * recipe.critic_coef * value_loss + recipe.bounds_coef * bounds_loss).mean(1)
        if recipe.entropy_coef:
            loss = loss - recipe.entropy_coef * self.head.entropy(mean, log_std)
        gradients = torch.autograd.grad(loss.sum(), list(self.network.parameters.values()))
        with torch.no_grad():
            new_mean, new_log_std = mean.detach(), log_std.detach().clone()
            divergence = self.head.divergence(new_mean, new_log_std, old_mean, old_log_std)
            self.adapt(divergence)
            self.descend(torch.cat([g.flatten(1) for g in gradients], dim=1))
            told = torch.cat((policy_loss.mean(1, keepdim=True), value_loss.mean(1, keepdim=True), divergence), dim=1)
        return new_mean, new_log_std, told

    def adapt(self, divergence: Tensor) -> None:
        """Per-lane learning rate from the KL divergence (L, 1) since the minibatch was last seen."""
        threshold, rate = self.recipe.kl_threshold, self.learning_rate
        rate = torch.where(divergence > 2.0 * threshold, rate / 1.5, rate)
        rate = torch.where(divergence < 0.5 * threshold, rate * 1.5, rate)
        self.learning_rate = rate.clamp(*LEARNING_RATES)

    def descend(self, gradient: Tensor) -> None:
        """Adam (arXiv 1412.6980) on all lanes' parameters, gradient (L, P) clipped by its norm per lane."""
        if self.recipe.max_grad_norm is not None:
            norm = gradient.norm(dim=1, keepdim=True)
            gradient = gradient * (self.recipe.max_grad_norm / (norm + 1e-6)).clamp(max=1.0)
        self._updates += 1
        self._first.lerp_(gradient, 0.1)
        self._second.mul_(0.999).addcmul_(gradient, gradient, value=0.001)
        first = self._first / (1.0 - 0.9**self._updates)
        second = self._second / (1.0 - 0.999**self._updates)
        step = self.learning_rate * first / (second.sqrt() + 1e-8)
        self.network.flat.sub_(torch.where(self.active[:, None], step, 0.0))
