"""Steps a task: clamp, act, simulate, count, score, then reset what is done."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor

from ..sim.base import aligned
from . import faults
from .choices import chosen
from .noise import WorldNoise
from .task import Score, State, Task, mean_over_steps


class Step(NamedTuple):
    """What one control step of N worlds produced. All tensors are fresh."""

    observation: Tensor
    """(N, O) clipped, after reset where done: what the policy sees next."""
    final_observation: Tensor
    """(N, O) clipped, before any reset: what a time-out is bootstrapped from."""
    state: State
    """State variables before any reset: what rewards are computed on."""
    terminated: Tensor
    """(N,) bool, failed, succeeded or broken physics."""
    timed_out: Tensor
    """(N,) bool, cut off by the episode length; never together with `terminated`."""
    score: Score
    ended: Tensor
    """(N,) bool, done, and the episode was a whole one: not the first of a staggered start."""
    episode_length: Tensor
    """(N,) int64, steps since the last reset, this one included."""
    bad: Tensor
    """(N,) bool, worlds whose physics broke down; they are reset and count for nothing."""

    @property
    def done(self) -> Tensor:
        return self.terminated | self.timed_out


class BatchedEnv:
    """N = L * n worlds of one task, with automatic reset.

    Unlike the original, which simulates one phantom step per episode, the step that ends an episode returns both the
    terminal observation and the one after the reset.

    Args:
        task: the task's class.
        worlds: worlds per lane, n.
        lane_seeds: one seed per lane, L.
        device: `cpu`, `cuda`, ... (see `sim.check_device`).
        threads: simulation threads, 0 for all cores (CPU only).

    Attributes:
        scored: compute the score of each step; else it is zero, so that a task can be watched before its F is written.
        watch: called when a step is simulated, before anything is reset.
        masked: reset by mask, which never waits for a GPU to say which worlds are done. A CPU resets by index.
    """

    def __init__(
        self, task: type[Task], *, worlds: int, lane_seeds: Sequence[int] = (0,), device: str = "cpu", threads: int = 0
    ) -> None:
        self.num_worlds = worlds * len(lane_seeds)
        self.sim = task.simulate(self.num_worlds, device, threads)
        self.task = task(self.sim, WorldNoise(lane_seeds, worlds, self.sim.device))
        self.scored = True
        self.watch: Callable[[], object] | None = None
        self.masked = device != "cpu"
        self._bad = torch.zeros((), dtype=torch.int64, device=self.sim.device)
        self._whole = torch.ones(self.num_worlds, dtype=torch.bool, device=self.sim.device)

    @property
    def bad_total(self) -> int:
        """Worlds whose physics broke down so far."""
        return int(self._bad)

    def check(self) -> None:
        """Raises TaskError when the simulator ran out of room; waits for the device, so call it between rollouts."""
        self.sim.check(self.task.env)

    def reset(self, *, stagger: bool = False) -> Tensor:
        """Start an episode in every world; returns the first observation (N, O).

        Raises TaskError when a state variable is a view of the simulator's or the task's memory, or a reset writes an
        attribute that `memory` does not list, or replaces a tensor that the simulator reads.

        Args:
            stagger: let the first episodes be cut off after a random part of the episode length. Worlds that all start
                together also time out together: F would then follow the phase of the episode rather than the policy.
        """
        worlds = torch.arange(self.num_worlds, device=self.sim.device)
        before, inputs = faults.marks(self.task), faults.inputs(self.task)
        self._reset(worlds)
        faults.check_inputs(self.task, inputs)
        faults.check_memory(self.task, before)
        if stagger:
            self.task.progress = self.task.noise.uniform(worlds, 1, 0, self.task.time_limit())[:, 0].long()
            self._whole = self.task.progress == 0
        state = self.task.compute_state()
        faults.check_variables(self.task, state)
        faults.check_views(self.task, state)
        state["obs_buf"] = self.task.observe(state)
        faults.check_observation(self.task, state)
        return self._observe(state)

    def state_dict(self, worlds: slice = slice(None)) -> dict[str, Any]:
        """All that the next step of these worlds depends on, copied; every tensor has the axis of worlds first."""
        task = {name: getattr(self.task, name) for name in self.task.lasting()}
        return {
            "whole": self._whole[worlds].clone(),
            "draws": self.task.noise.draws[worlds].clone(),
            "task": {name: value[worlds].clone() for name, value in task.items()},
            "sim": {name: value[worlds].clone() for name, value in self.sim.memory().items()},
        }

    def load_state_dict(self, saved: Mapping[str, Any]) -> None:
        """Continue, in a new environment, from states of the same task, with as many worlds in all."""
        self._whole = saved["whole"]
        self.task.noise.draws.copy_(saved["draws"])
        for name in self.task.lasting():
            setattr(self.task, name, saved["task"][name])
        self.sim.load_state_dict(saved["sim"])

    def step(self, actions: Tensor) -> Step:
        """Advance all worlds by one action (N, A): clamped to [-1, 1], or the greatest value of each choice."""
        task = self.task
        task.actions = chosen(actions, task.choices) if task.choices else actions.clamp(-1.0, 1.0)
        self._advance(task.actions)
        if self.watch is not None:
            self.watch()
        task.progress += 1

        bad = self.sim.bad.clone()
        state = self.current_state()
        if (outcome := task.outcome(state)) is not None:
            state["outcome"] = faults.per_world(task, "outcome", outcome).clone()
        terminated = faults.decided(task, "terminated", task.terminated(state)) | bad
        timed_out = faults.decided(task, "timed_out", task.timed_out(state)) & ~terminated
        done = terminated | timed_out
        ended = done & self._whole
        score = self._score(state, ended, bad)
        length = task.progress.clone()
        final = self._observe(state)

        observation = self._restart(done, final)
        self._bad += bad.sum()
        self._whole = self._whole | done
        return Step(observation, final, state, terminated, timed_out, score, ended, length, bad)

    def _advance(self, actions: Tensor) -> None:
        """Simulate one control step under these actions."""
        self.task.apply_action(actions)
        self.task.advance()

    def _score(self, state: State, ended: Tensor, bad: Tensor) -> Score:
        """F of this step; worlds whose physics broke down have no weight in it. Without `scored`, F is 0."""
        if not self.scored:
            return mean_over_steps(torch.zeros(len(bad), device=bad.device))
        value, weight = faults.scored(self.task, self.task.fitness(state, ended))
        weight = torch.where(bad | ~self._whole if self.task.scores_episodes else bad, 0.0, weight)
        # A value without weight may be undefined, such as 0 / 0, and would spoil a sum: 0 times NaN is NaN.
        return Score(value.masked_fill((weight == 0) & ~value.isfinite(), 0.0), weight)

    def _restart(self, done: Tensor, final: Tensor) -> Tensor:
        """Reset worlds (N,) that are done; returns the observation of all, which is `final` in the others."""
        if self.masked:
            self._reset_masked(done)
            return torch.where(done[:, None], self._observe(self.current_state()), final)
        worlds = done.nonzero().squeeze(-1)
        if not len(worlds):
            return final
        self._reset(worlds)
        observation = final.clone()
        observation[worlds] = self._observe(self.current_state(), worlds)
        return observation

    def _reset(self, worlds: Tensor) -> None:
        self.task.progress[worlds] = 0
        self.task.actions = self.task.actions.index_fill(0, worlds, 0.0)  # a copy: the step's state holds the old one
        self.sim.reset(worlds)
        self.task.reset(worlds)
        self.sim.forward(worlds)

    def _reset_masked(self, done: Tensor) -> None:
        """Reset every world, then put back those that are not done: the work is the same whichever are done, so the
        host need not know."""
        task = self.task
        fields = [(field, field.clone()) for field in self.sim.writable()]
        memory = [(name, getattr(task, name).clone()) for name in task.memory]
        draws = task.noise.draws.clone()
        task.progress.masked_fill_(done, 0)
        task.actions = task.actions.masked_fill(done[:, None], 0.0)
        self.sim.reset(done)
        task.reset(torch.arange(self.num_worlds, device=done.device))
        for value, before in [*fields, *((getattr(task, name), value) for name, value in memory)]:
            value.copy_(torch.where(aligned(done, value), value, before))
        task.noise.draws.copy_(torch.where(done, task.noise.draws, draws))
        self.sim.forward(done)

    def current_state(self) -> dict[str, Any]:
        """Every state variable as of now, `obs_buf` included."""
        state = self.task.compute_state()
        state["obs_buf"] = self.task.observe(state)
        return state

    def _observe(self, state: State, worlds: Tensor | slice = slice(None)) -> Tensor:
        return state["obs_buf"][worlds].clamp(-self.task.clip_observations, self.task.clip_observations)
