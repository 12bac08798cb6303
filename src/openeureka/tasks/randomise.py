"""Worlds that differ: each draws its physics, its delay, its noise and its pushes, anew for every episode."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from ..sim.perturb import FACTORS, Perturbed
from ..types import NOMINAL, Ranges
from ..types.dynamics import QUANTITIES
from .anatomy import floating_joint
from .env import BatchedEnv
from .noise import WorldNoise
from .task import State, Task

EPISODES, STEPS, PUSHES = 1 << 33, 1 << 34, 1 << 35
"""Added to a lane's seed, so that draws made here do not change the task's own draws."""


class RandomisedEnv(BatchedEnv):
    """A `BatchedEnv` whose worlds are drawn from ranges.

    What a world is depends on seed, world and episode alone, so lanes of equal seeds see the same worlds, whatever
    their policies do. Its noise and pushes depend on seed, world and step. Rewards and F see the state without noise,
    and the action that the policy asked for.

    Args:
        ranges: one per lane.
        worlds, lane_seeds, device, threads: as of `BatchedEnv`.
    """

    def __init__(
        self,
        task: type[Task],
        *,
        ranges: Sequence[Ranges],
        worlds: int,
        lane_seeds: Sequence[int] = (0,),
        device: str = "cpu",
        threads: int = 0,
    ) -> None:
        super().__init__(task, worlds=worlds, lane_seeds=lane_seeds, device=device, threads=threads)
        device_ = self.sim.device
        drawn = {name for lane in ranges for name in lane.drawn}

        def ends(which: str) -> Tensor:
            rows = [[getattr(getattr(lane, which), name) for name in QUANTITIES] for lane in ranges]
            return torch.tensor(rows, device=device_).repeat_interleave(worlds, 0)

        self._low, self._high = ends("low"), ends("high")
        self._episodes = WorldNoise([seed + EPISODES for seed in lane_seeds], worlds, device_)
        self._steps = WorldNoise([seed + STEPS for seed in lane_seeds], worlds, device_)
        self._pushes = WorldNoise([seed + PUSHES for seed in lane_seeds], worlds, device_)
        """Apart from `_steps`, so that a lane's noise is the same whether or not other lanes are pushed."""
        own = torch.tensor([getattr(NOMINAL, name) for name in QUANTITIES], device=device_)
        self.worlds = own.repeat(self.num_worlds, 1)
        """(N, quantities) of each world as it is now, in the order of `Dynamics`."""
        self._every = torch.arange(self.num_worlds, device=device_)
        self._model = Perturbed(self.sim, [name for name in FACTORS if name in drawn])
        model = self.sim.model
        floating = floating_joint(model)
        self._noisy = "noise" in drawn
        self._pushed = "push" in drawn and floating >= 0  # older runs may have pushes of what a hand holds
        self._errors = torch.zeros(self.num_worlds, task.num_observations, device=device_)
        self._latest = self._late(self._high[:, QUANTITIES.index("delay")])
        self._asked = torch.zeros(self.num_worlds, 1 + int(self._latest.max()), task.num_actions, device=device_)
        """Actions of the last steps, the newest first."""
        if self._pushed:
            self._forces = self.sim.bind("xfrc_applied")
            self._base = int(model.jnt_bodyid[floating])
            self._mass = float(model.body_subtreemass[self._base])

    def quantity(self, name: str) -> Tensor:
        """(N,) one quantity of each world as it is now."""
        return self.worlds[:, QUANTITIES.index(name)]

    def reset(self, *, stagger: bool = False) -> Tensor:
        self._mistake()
        return super().reset(stagger=stagger)

    def state_dict(self, worlds: slice = slice(None)) -> dict[str, Any]:
        own = {name: value[worlds].clone() for name, value in self._memory().items()}
        return {**super().state_dict(worlds), "random": own}

    def load_state_dict(self, saved: Mapping[str, Any]) -> None:
        super().load_state_dict(saved)
        before = saved["random"]
        # Lanes that have a result by now may have had longer delays than any that is left.
        before = {**before, "asked": before["asked"][:, : self._asked.shape[1]]}
        for name, value in self._memory().items():
            value.copy_(before[name])

    def _memory(self) -> dict[str, Tensor]:
        own = {"worlds": self.worlds, "asked": self._asked}
        return own | {"episodes": self._episodes.draws, "steps": self._steps.draws, "pushes": self._pushes.draws}

    def _advance(self, actions: Tensor) -> None:
        self._mistake()
        self._asked = torch.cat((actions[:, None], self._asked[:, :-1]), dim=1)
        late = torch.minimum(self._late(self.quantity("delay")), self._latest)
        acted = self._asked.gather(1, late[:, None, None].expand(-1, 1, actions.shape[1]))[:, 0]
        if not self._pushed:
            super()._advance(acted)
            return
        self.task.apply_action(acted)
        before = self._forces[:, self._base].clone()
        self._forces[:, self._base, :2] += self._push()
        self.task.advance()
        self._forces[:, self._base] = before

    def _late(self, delay: Tensor) -> Tensor:
        """(N,) steps of a delay (N,) [s]. In single precision 0.09 s / 0.02 s is above 4.5, in double it is not."""
        return (delay / self.task.control_dt).round().long()

    def _push(self) -> Tensor:
        """(N, 2) force [N] of the push on this step; 0 in most worlds."""
        chance, angle = self._pushes.uniform(self._every, 2).unbind(-1)
        dt = self.task.control_dt
        size = self.quantity("push") * self.quantity("mass") * self._mass / dt
        size = size * (chance < dt / self.quantity("push_every"))
        return size[:, None] * torch.stack(((2 * math.pi * angle).cos(), (2 * math.pi * angle).sin()), dim=-1)

    def _mistake(self) -> None:
        if self._noisy:
            errors = self._steps.uniform(self._every, self._errors.shape[1], -1.0, 1.0)
            self._errors = errors * self.quantity("noise")[:, None]

    def _observe(self, state: State, worlds: Tensor | slice = slice(None)) -> Tensor:
        if not self._noisy:
            return super()._observe(state, worlds)
        return super()._observe({"obs_buf": state["obs_buf"] + self._errors}, worlds)

    def _reset(self, worlds: Tensor) -> None:
        self._redraw(torch.zeros_like(self.sim.bad).index_fill(0, worlds, True))
        super()._reset(worlds)

    def _reset_masked(self, done: Tensor) -> None:
        self._redraw(done)
        super()._reset_masked(done)

    def _redraw(self, worlds: Tensor) -> None:
        """Draw worlds (N,) bool anew."""
        draws = self._episodes.draws.clone()
        new = self._episodes.uniform(self._every, len(QUANTITIES), self._low, self._high)
        self._episodes.draws.copy_(torch.where(worlds, self._episodes.draws, draws))
        self.worlds = torch.where(worlds[:, None], new, self.worlds)
        self._asked = self._asked.masked_fill(worlds[:, None, None], 0.0)
        self._model.write({name: self.quantity(name) for name in FACTORS}, worlds)
