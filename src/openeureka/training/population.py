"""Trains a generation at once: L lanes (reward program x seed) of n worlds each in one simulation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from ..errors import TaskError
from ..tasks import registry
from ..tasks.deployment import as_text, described
from ..tasks.env import Step
from ..tasks.task import Task
from ..types import (
    COMPONENT,
    NOMINAL,
    Checkpoint,
    LaneSpec,
    Ranges,
    TrainBudget,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)
from . import pausing
from .curves import Curves
from .policy import Policy
from .ppo import PPO, Rollout
from .rewards import LaneRewards

ABSURD = 1e6  # a reward of this size per step is a fault, not a preference
PROGRESS_SECONDS = 1.0


class Population:
    """One batch of lanes of one task.

    Args:
        env: name of the task.
        specs: one per lane.
        budget: steps and worlds of each lane; zeros take the task's recipe.
        alive: called after every step of all worlds, replayed ones included, and after what else may take minutes.

    Attributes:
        kind: kind of device, stored with each state: lanes continue only from states of the same kind.
        epoch: number of epochs done.
        until: number of epochs after which the lanes pause or end.
        clock: [s] of training until the end of each epoch's rollout, earlier processes included.
    """

    def __init__(
        self,
        env: str,
        specs: Sequence[LaneSpec],
        budget: TrainBudget,
        *,
        device: str = "cpu",
        threads: int = 0,
        alive: Callable[[], object] = lambda: None,
    ) -> None:
        task = registry.get(env)
        alive()
        self.env_name, self.specs, self.recipe = env, list(specs), task.recipe
        self.kind = device.partition(":")[0]
        self.lanes, self.worlds = len(specs), budget.worlds or task.recipe.worlds
        self.horizon = task.recipe.horizon
        self.epochs = max(1, (budget.env_steps or task.recipe.env_steps) // (self.worlds * self.horizon))
        self.until = max(1, round(budget.until * self.epochs))
        seeds = [spec.seed for spec in specs]
        drawn = [spec.randomise or budget.randomise for spec in specs]
        ranges = [own or Ranges(NOMINAL, NOMINAL) for own in drawn] if any(drawn) else []
        self.env = registry.make(
            env, worlds=self.worlds, lane_seeds=seeds, device=device, threads=threads, ranges=ranges
        )
        alive()
        self.env.sim.after_replayed_step = self._alive = alive
        self.device = self.env.sim.device
        self.rewards = LaneRewards(self.env.task, [spec.program for spec in specs], self.worlds, bonus=budget.bonus)
        self.ppo = PPO(
            seeds,
            task.num_observations,
            task.num_actions,
            task.recipe,
            self.device,
            task.choices,
            task.unseen(budget.observe),
        )
        self.interface = _interface(task, self.ppo.network.unseen)
        self._put_starts()
        self.rollout = Rollout(
            self.lanes, self.worlds, self.horizon, task.num_observations, task.num_actions, self.device
        )
        self.curves = self._curves(task)
        self._early = task.episode_length // 4  # steps that count as early in an episode
        self.best_fitness: list[Kept | None] = [None] * self.lanes
        self.best_reward: list[Kept | None] = [None] * self.lanes
        self._largest = torch.zeros(self.lanes, device=self.device)
        """(L,) largest absolute own reward of this epoch; NaN if any reward was NaN."""
        self.messages = [""] * self.lanes
        self.trained = [self.epochs] * self.lanes  # epochs until the lane ended
        self.epoch, self.observation = 0, self._split(self.env.reset(stagger=True))
        alive()
        self.clock: list[float] = []
        self._before, self._started = 0.0, time.monotonic()  # [s] in earlier processes; start of this one
        paused = [pausing.load(spec.paused, self.device) for spec in specs if spec.paused is not None]
        # On another kind of device worlds and noise differ: then all lanes of the batch begin anew.
        if paused and {pausing.kind(lane) for lane in paused} == {self.kind}:
            self.load_lanes(paused)

    def _put_starts(self) -> None:
        """Let lanes that continue a policy begin with its weights."""
        for lane, spec in enumerate(self.specs):
            if spec.start is not None:
                Policy.from_bytes(spec.start).put(self.ppo, lane, fresh=spec.fresh, rescaled=spec.rescaled)

    def _curves(self, task: type[Task]) -> Curves:
        window = task.window()
        return Curves(
            self.lanes,
            self.worlds,
            window=window,
            # Capped by the epochs of the whole training: a short one has an F at its end at least. A pause does not
            # count as the end, so that a lane that pauses has the same curves as one that does not.
            full=min(window, self.epochs),
            settled=0 if task.counts_early else min(2 * window, self.epochs),
            components=self.rewards.components,
            device=self.device,
        )

    def train(self) -> Iterator[TrainingEvent]:
        """Yields progress about once a second, then one result per lane. After each progress the state may be saved."""
        began, self._started = self.epoch, time.monotonic()
        reported = self._started
        observation = self.observation
        for epoch in range(self.epoch, self.until):
            for t in range(self.horizon):
                action = self.ppo.act(observation)
                step = self.env.step(action.action.flatten(0, 1))
                self._alive()
                early = (step.episode_length <= self._early).float()
                own, human, means = self.rewards(step.state, early)
                # A world whose physics broke down was put back: the policy did not earn what this state pays.
                bad = self._split(step.bad)
                own, human = own.masked_fill(bad, 0.0), human.masked_fill(bad, 0.0)
                self.curves.add(step, own, human, means, early)
                self._watch(own)
                if (bonus := self.rewards.bonus(step.state, bad, self.curves.moments)) is not None:
                    own = own + bonus
                reward = own * self.recipe.reward_scale
                if self.recipe.bootstrap_timeouts:
                    reward = reward + self.recipe.gamma * self._beyond(step)
                self.rollout.store(t, observation, action, reward, self._split(step.done))
                observation = self._split(step.observation)
            self.env.check()
            self._mask_diverged(epoch)
            self._checkpoint(epoch)
            self.clock.append(self._seconds())
            if not bool(self.ppo.active.any()):
                break
            self.ppo.update(self.rollout, self.ppo.value(observation))
            self.curves.learned(self.ppo.statistics)
            self.epoch, self.observation = epoch + 1, observation
            now = time.monotonic()
            if now - reported > PROGRESS_SECONDS:
                reported = now
                yield self._progress((self.epoch - began) / (now - self._started))
        seconds = self._seconds()
        for lane in range(self.lanes):
            yield self._result(lane, seconds)

    def _beyond(self, step: Step) -> Tensor:
        """(L, n) value of what follows a time-out, 0 where no time-out is."""
        observation, timed_out = self._split(step.final_observation), self._split(step.timed_out)
        if not self.env.masked:
            return self.ppo.value_where(observation, timed_out)
        # On a GPU, asking how many time-outs there are costs more than computing values that are not needed.
        return torch.where(timed_out, self.ppo.value(observation), 0.0)

    def snapshot(self) -> bytes:
        """The states of all lanes, by id."""
        return pausing.save({spec.id: self.lane_state(lane) for lane, spec in enumerate(self.specs)})

    def resume(self, snapshot: bytes) -> None:
        """Continue, in a new population, from a snapshot of these lanes or of more, made on the same kind of device."""
        lanes = pausing.load(snapshot, self.device)
        self.load_lanes([lanes[spec.id] for spec in self.specs])

    def lane_state(self, lane: int) -> pausing.State:
        """All that the next epoch of one lane depends on, copied."""
        worlds = slice(lane * self.worlds, (lane + 1) * self.worlds)
        peaks = self.best_fitness[lane], self.best_reward[lane]
        return {
            "device": self.kind,
            "epoch": self.epoch,
            "seconds": self._seconds(),
            "clock": self.clock,
            "observation": self.observation[lane : lane + 1].clone(),
            "env": self.env.state_dict(worlds),
            "ppo": self.ppo.lane_state(lane),
            "curves": self.curves.lane_state(lane),
            "rewards": self.rewards.lane_state(lane),
            "peaks": [[peak.state_dict() if peak is not None else None] for peak in peaks],
            "messages": [self.messages[lane]],
            "trained": [self.trained[lane]],
        }

    def load_lanes(self, lanes: Sequence[pausing.State]) -> None:
        """Continue, in a new population, lanes of this task and budget that paused at the same epoch.

        A lane that was alone, or beside the same lanes, continues bit for bit. Epoch, seconds and clock, which lanes
        share, are those of the slowest lane."""
        slowest = max(lanes, key=lambda lane: lane["seconds"])
        self.epoch, self._before, self.clock = (slowest[name] for name in ("epoch", "seconds", "clock"))
        self.observation = torch.cat([lane["observation"] for lane in lanes])
        self.env.load_state_dict(pausing.joined([lane["env"] for lane in lanes]))
        self.ppo.load_lanes([lane["ppo"] for lane in lanes])
        self.curves.load_lanes([lane["curves"] for lane in lanes])
        if "rewards" in lanes[0]:  # an older version saved none, and knew no bonus that needs them
            self.rewards.load_lanes([lane["rewards"] for lane in lanes])
        self.best_fitness = [self._kept(lane["peaks"][0][0]) for lane in lanes]
        self.best_reward = [self._kept(lane["peaks"][1][0]) for lane in lanes]
        self.messages = [lane["messages"][0] for lane in lanes]
        self.trained = [lane["trained"][0] for lane in lanes]

    def _kept(self, peak: Mapping[str, Any] | None) -> Kept | None:
        """Inverse of `Kept.state_dict`; None where a lane has no peak yet."""
        if peak is None:
            return None
        policy = Policy(self.env_name, peak["policy"], self.ppo.choices, self.ppo.network.unseen, self.interface)
        return Kept(peak["epoch"], peak["value"], policy)

    def _now(self, lane: int) -> Policy:
        return Policy.of(self.env_name, self.ppo, lane, self.interface)

    def _seconds(self) -> float:
        return self._before + time.monotonic() - self._started

    def _split(self, x: Tensor) -> Tensor:
        """(N, ...) to (L, n, ...)."""
        return x.view(self.lanes, self.worlds, *x.shape[1:])

    def _watch(self, own: Tensor) -> None:
        self._largest = torch.maximum(self._largest, own.abs().amax(1))

    def _mask_diverged(self, epoch: int) -> None:
        """Freeze lanes whose reward or policy is no longer a usable number; the others are not affected."""
        usable = self._largest <= ABSURD  # False for NaN
        sound = torch.isfinite(self.ppo.network.flat).all(1)
        for lane in (self.ppo.active & ~(usable & sound)).nonzero().flatten().tolist():
            if not sound[lane]:
                self._stop(lane, epoch, "the policy was not finite")
            else:
                self._stop(lane, epoch, self.rewards.error(lane) or "the reward was not finite or beyond 1e6")
        # Frozen lanes still flow through the shared kernels: zeros keep them finite.
        self.rollout.reward[~self.ppo.active] = 0.0
        self._largest.zero_()

    def _stop(self, lane: int, epoch: int, why: str) -> None:
        self.ppo.active[lane] = False
        self.trained[lane] = epoch + 1
        self.messages[lane] = f"stopped in epoch {epoch + 1} of {self.epochs}: {why}"

    def _checkpoint(self, epoch: int) -> None:
        """Keep the policy that produced this epoch wherever F or the own reward peaks."""
        late = 9 * self.until // 10
        if epoch == late:
            self.curves.forget_parts()  # some may be from the epochs before a rung
        fitness, own = self.curves.close_epoch(parts=epoch >= late)
        for lane, active in enumerate(self.ppo.active.tolist()):
            if not active:
                continue
            if not math.isfinite(fitness[lane] or 0.0):
                self._stop(lane, epoch, "the task's score was not a finite number")
                continue
            for peaks, value in ((self.best_fitness, fitness[lane]), (self.best_reward, own[lane])):
                known = peaks[lane]
                if value is not None and (known is None or value > known.value):
                    peaks[lane] = Kept(epoch, value, self._now(lane))

    def _progress(self, epochs_per_second: float) -> TrainingProgress:
        best = {spec.id: peak.value if peak else None for spec, peak in zip(self.specs, self.best_fitness, strict=True)}
        rate = epochs_per_second * self.horizon * self.worlds * self.lanes
        latest = {spec.id: _newest(curves) for spec, curves in zip(self.specs, self.curves.curves, strict=True)}
        return TrainingProgress(
            epoch=self.epoch, epochs=self.until, env_steps_per_second=rate, fitness=best, latest=latest
        )

    def _result(self, lane: int, seconds: float) -> TrainingResult:
        peak, peak_reward = self.best_fitness[lane], self.best_reward[lane]
        message = self.messages[lane]
        trained = self.trained[lane] if message else self.until
        paused = not message and self.until < self.epochs
        ended = TrainingState.PAUSED if paused else TrainingState.FINISHED
        curves = {name: tuple(curve[:trained]) for name, curve in self.curves.curves[lane].items()}
        return TrainingResult(
            lane=self.specs[lane].id,
            state=TrainingState.DIVERGED if message else ended,
            fitness=peak.value if peak else None,
            curves=curves if message else curves | self.curves.early_and_late(lane),
            env_steps=trained * self.horizon * self.worlds,
            seconds=seconds,
            clock=tuple(round(time, 3) for time in self.clock[:trained]),
            # A stopped lane's worlds went on and were counted, because other lanes still trained.
            correlation=None if message else self.curves.correlation(lane),
            best_fitness=peak.checkpoint() if peak else None,
            best_reward=peak_reward.checkpoint() if peak_reward else None,
            last=None if message else self._now(lane).to_bytes(),
            paused=pausing.save(self.lane_state(lane)) if paused else None,
            message=message,
        )


def _interface(task: type[Task], unseen: Sequence[int]) -> dict[str, str]:
    """What a policy file says of its task; empty where the task's `deployment` is wrong, which the report says."""
    try:
        return as_text(described(task, unseen))
    except TaskError:
        return {}


def _newest(curves: Mapping[str, Sequence[float | None]]) -> dict[str, float | None]:
    """Newest point of each curve that is shown while a lane trains."""
    followed = {name: curve for name, curve in curves.items() if name.startswith(("fitness", "reward", COMPONENT))}
    return {name: curve[-1] for name, curve in followed.items() if curve}


@dataclass(frozen=True, slots=True)
class Kept:
    """The best epoch so far, with its policy still as tensors."""

    epoch: int
    value: float
    policy: Policy

    def state_dict(self) -> dict[str, Any]:
        return {"epoch": self.epoch, "value": self.value, "policy": dict(self.policy.tensors)}

    def checkpoint(self) -> Checkpoint:
        return Checkpoint(epoch=self.epoch, value=self.value, policy=self.policy.to_bytes())
