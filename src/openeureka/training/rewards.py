"""What each lane is paid, computed on the same state: its reward, and a bonus for rare progress."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence, Set
from typing import Any

import torch
from torch import Tensor

from ..reward import graph
from ..tasks.faults import per_world
from ..tasks.task import State, Task
from ..types import PROGRESS, Bonus, RewardProgram
from .replay import Replay, waits

MAX_CALL_SECONDS = 2.0
"""Most processor time of one lane's reward for one step on a CPU: four times what the check allows."""
ROUNDING = 1e-12
"""A difference of sums of squares that is below this share of the sums is rounding."""
VALUES = 3
"""Progress values of a program that count; further ones do not."""
BINS = 10
"""Bins of each progress value. Three values make 1,000 bins. A training of a million steps, evenly spread, visits each
a thousand times, and in the end pays 3 % of what a first visit pays. With finer bins everything would stay new."""


class LaneRewards:
    """Runs the reward programs of L lanes on their slices of the worlds.

    On a GPU the generated programs of neighbouring lanes are one launch, except those that wait for the device, such as
    by selecting worlds with a mask. Sixteen programs of thirty small operations would otherwise cost more than the
    physics.

    Args:
        task: the task whose human and sparse reward may be among the programs.
        programs: one per lane.
        worlds: worlds per lane, n.
        bonus: what is added to generated rewards, see `TrainBudget`.

    Attributes:
        components: (lane, name) of each component of any program.
        counts: visits of progress bins; None unless the bonus is paid for progress.
    """

    def __init__(self, task: Task, programs: Sequence[RewardProgram], worlds: int, *, bonus: Bonus = "none") -> None:
        self.task, self.programs, self.worlds, self._bonus = task, list(programs), worlds, bonus
        self._compiled = {
            lane: graph.CompiledReward(program, task.spec)
            for lane, program in enumerate(programs)
            if not isinstance(program, str)
        }
        self.components = [
            (lane, name) for lane, program in self._compiled.items() for name, _ in program.graph.components
        ]
        self._per_world = set(task.spec.per_world)
        generated = [lane in self._compiled for lane in range(len(self.programs))]
        self._generated = torch.tensor(generated, dtype=torch.float32, device=task.device)[:, None]
        self.counts = ProgressCounts(len(self.programs), task.device) if bonus == "progress" else None
        self._progress = torch.full((len(self.programs), VALUES, worlds), math.nan, device=task.device)
        """Progress values of the last step; NaN for lanes that have none, 0 in place of those that a lane lacks."""
        self._parts: list[_Part] = []

    def __call__(self, state: State, early: Tensor | None = None) -> tuple[Tensor, Tensor, Tensor]:
        """Own reward (L, n), human reward (L, n), and (components, 2): the mean of each of `components` over its lane's
        worlds, and the mean of its product with `early` (N,)."""
        lanes, n = len(self.programs), self.worlds
        task = self.task
        human = per_world(task, "human_reward", task.human_reward(state)).view(lanes, n)
        own = human.clone()
        sparse = None
        if "sparse" in self.programs:
            sparse = per_world(task, "sparse_reward", task.sparse_reward(state)).view(lanes, n)
        for lane, program in enumerate(self.programs):
            if program == "sparse" and sparse is not None:
                own[lane] = sparse[lane]
        means = []
        early = torch.zeros_like(human).flatten() if early is None else early
        for part in self._parts or self._prepare(state, early):
            *found, own_means = part(state, early)
            for lane, reward in zip(part.lanes, found[: len(part.lanes)], strict=True):
                own[lane] = reward
            for lane, values in zip(part.progress, found[len(part.lanes) :], strict=True):
                self._progress[lane] = values
            means.append(own_means)
        return own, human, torch.cat(means) if means else own.new_zeros(0, 2)

    def _prepare(self, state: State, early: Tensor) -> list[_Part]:
        """Parts in the order of `components`: runs of lanes that can be recorded, and single ones that cannot."""
        for lane, program in self._compiled.items():
            alone = self._part({lane: program}, recorded=False)
            recorded = not waits(lambda part=alone: part(state, early))
            if recorded and self._parts and self._parts[-1].recorded:
                programs = {**self._parts.pop().programs, lane: program}
            else:
                programs = {lane: program}
            self._parts.append(self._part(programs, recorded=recorded))
        return self._parts

    def _part(self, programs: Mapping[int, graph.CompiledReward], *, recorded: bool) -> _Part:
        counting = self.counts is not None
        return _Part(programs, self.worlds, self._per_world, recorded=recorded, counting=counting)

    def error(self, lane: int) -> str:
        """The first error of a lane's program, empty if it had none."""
        return next((part.errors[lane] for part in self._parts if lane in part.errors), "")

    def bonus(self, state: State, bad: Tensor, sums: Tensor) -> Tensor | None:
        """What is added to the own rewards (L, n) for training only; curves and correlations leave it out.

        Args:
            state: that of the last call.
            bad: (L, n) worlds that broke down: they are paid nothing.
            sums: (L, 6), sum of `moments` so far. The bonus for progress is in standard deviations of a lane's own
                reward, because rewards come in any unit.
        """
        if self.counts is not None:
            return self.counts(self._progress, ~bad) * spread(sums)[:, None]
        bonus = self.task.success_bonus(state) if self._bonus == "original" else None
        return None if bonus is None else (bonus.view(-1, self.worlds) * self._generated).masked_fill(bad, 0.0)

    def lane_state(self, lane: int) -> dict[str, Any]:
        """All that is kept of a lane between two steps, copied."""
        return {"visits": self.counts.visits[lane : lane + 1].clone()} if self.counts is not None else {}

    def load_lanes(self, lanes: Sequence[Mapping[str, Any]]) -> None:
        if self.counts is not None:
            self.counts.visits = torch.cat([lane["visits"] for lane in lanes])


class _Part:
    """Some lanes' programs as one function of the state: each lane's reward (n,), the progress values (3, n) of each
    lane of `progress`, and the means of all components."""

    def __init__(
        self,
        programs: Mapping[int, graph.CompiledReward],
        worlds: int,
        per_world: Set[str],
        *,
        recorded: bool,
        counting: bool,
    ) -> None:
        self.programs, self.recorded = programs, recorded
        self.lanes = tuple(programs)
        named = {lane: _progress(program) for lane, program in programs.items()} if counting else {}
        self.progress = {lane: names for lane, names in named.items() if names}
        self._worlds, self._per_world = worlds, per_world
        self._names = sorted({name for program in programs.values() for name in program.inputs})
        self._numbers: dict[str, float | int] = {}
        self.errors: dict[int, str] = {}
        self._run = Replay(self._evaluate) if recorded else self._evaluate

    def __call__(self, state: State, early: Tensor) -> tuple[Tensor, ...]:
        # Numbers are constants of the task, so a recording may hold them.
        self._numbers = {name: state[name] for name in self._names if not isinstance(state[name], Tensor)}
        return self._run([early, *(state[name] for name in self._names if name not in self._numbers)])

    def _evaluate(self, tensors: Sequence[Tensor]) -> tuple[Tensor, ...]:
        n = self._worlds
        early, *rest = tensors
        named = iter(rest)
        weights = torch.stack((torch.ones_like(early), early), dim=-1) / n
        values = {name: next(named) for name in self._names if name not in self._numbers}
        rewards, progress, means = [], [], []
        for lane in self.programs:
            own = {name: value[lane * n : (lane + 1) * n] for name, value in values.items() if name in self._per_world}
            reward, components = self._of_lane(lane, {**self._numbers, **values, **own, "num_envs": n})
            rewards.append(reward)
            if names := self.progress.get(lane):
                none = [torch.zeros_like(reward)] * (VALUES - len(names))
                progress.append(torch.stack([*(components[name] for name in names), *none]))
            if components:  # one product: a mean of each would take longer
                means.append(torch.stack(list(components.values())) @ weights[lane * n : (lane + 1) * n])
        return (*rewards, *progress, torch.cat(means) if means else rewards[0].new_zeros(0, 2))

    def _of_lane(self, lane: int, state: State) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Reward (n,) and components of one lane; NaN from the first error on, so that the lane is stopped."""
        program, n, started = self.programs[lane], self._worlds, time.thread_time()
        try:
            if lane not in self.errors:
                reward, components = program(state, n)
                seconds = time.thread_time() - started
                if seconds < MAX_CALL_SECONDS or reward.device.type != "cpu":
                    return reward, components
                self.errors[lane] = f"the reward took {seconds:.1f} s for one step"
        except (IndexError, RuntimeError) as error:  # such as an index that no recorded state had
            if any(isinstance(value, Tensor) and value.device.type != "cpu" for value in state.values()):
                raise  # after a fault a GPU computes nothing more in this process
            self.errors[lane] = f"the reward failed with {type(error).__name__}: {error}"[:300]
        reward = torch.full((n,), math.nan)
        return reward, {name: reward for name, _ in program.graph.components}


def _progress(program: graph.CompiledReward) -> list[str]:
    return [name for name, _ in program.graph.components if name.startswith(PROGRESS)][:VALUES]


def moments(own: Tensor, human: Tensor) -> Tensor:
    """Sums (L, 6) float64 over worlds that `correlation` needs: 1, x, y, x^2, y^2, xy."""
    x, y = own.double(), human.double()
    return torch.stack((torch.ones_like(x), x, y, x * x, y * y, x * y), dim=-1).sum(1)


def spread(sums: Tensor) -> Tensor:
    """Standard deviation (L,) of the own rewards, from sums (L, 6) of `moments`; 1 where it is 0 or not finite."""
    count, x, _, xx, _, _ = sums.unbind(dim=-1)
    mean, square = x / count, xx / count
    variance = square - mean * mean
    known = (variance > ROUNDING * square) & torch.isfinite(variance)
    return torch.where(known, variance, 1.0).sqrt().float()


def correlation(sums: Tensor) -> float | None:
    """Pearson correlation from the six sums of one lane; None when either side is constant or not finite."""
    count, x, y, xx, yy, xy = sums.tolist()
    spread_x, spread_y = xx - x * x / count, yy - y * y / count
    if not (spread_x > ROUNDING * xx and spread_y > ROUNDING * yy):
        return None
    return (xy - x * y / count) / (spread_x * spread_y) ** 0.5


class ProgressCounts:
    """Counts visits of progress bins, and pays for rare ones: each of L lanes has its own table.

    The idea is that of progress counts (arXiv 2410.09187): a program says coarsely how far an episode has come, and a
    policy is paid for states that its training has rarely reached so far, by the inverse root of visits (arXiv
    1606.01868).

    Attributes:
        visits: (L, 1000) integers, because their sums are exact in any order, also on a GPU.
    """

    def __init__(self, lanes: int, device: torch.device) -> None:
        self.visits = torch.zeros(lanes, BINS**VALUES, dtype=torch.int64, device=device)
        self._places = BINS ** torch.arange(VALUES, device=device)[:, None]

    def __call__(self, values: Tensor, counted: Tensor) -> Tensor:
        """Count a step of n worlds, and return what it pays: (L, n), 1 / sqrt(visits of the bin), this step included.

        Args:
            values: (L, 3, n), clamped to 0..1. A world where one of them is not finite is neither counted nor paid.
            counted: (L, n), false for further worlds that are neither counted nor paid.
        """
        counted = counted & torch.isfinite(values).all(1)
        steps = (values.nan_to_num(0.0).clamp(0.0, 1.0) * BINS).long().clamp(max=BINS - 1)
        bins = (steps * self._places).sum(1)
        self.visits.scatter_add_(1, bins, counted.long())
        return counted / self.visits.gather(1, bins).clamp(min=1).sqrt()
