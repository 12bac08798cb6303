"""Training curves: one point per lane and epoch."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import torch
from torch import Tensor

from ..tasks.env import Step
from ..types import COMPONENT
from .ppo import STATISTICS
from .rewards import correlation, moments

Each = TypeVar("Each", Tensor, float)


class Sums(NamedTuple, Generic[Each]):
    """What is summed over the worlds and steps of an epoch: tensors, or the numbers of one lane."""

    value: Each
    """Of F, times its weight."""
    weight: Each
    length: Each
    """[steps] Of episodes that ended."""
    ended: Each
    """Episodes that ended."""
    own: Each
    human: Each
    early: Each
    """Transitions early in an episode."""
    terminated: Each
    """Weight of F on steps that terminated an episode."""
    elsewhere: Each
    """Weight of F on steps that ended none."""


class Curves:
    """Sums over the steps of an epoch, and the curves made of them.

    Only F is averaged over several epochs: the last `window`, which are as long as an episode. In one epoch only a
    dozen of some hundred worlds end an episode, and worlds that once failed together stay in phase: the maximum over
    single epochs would reward luck and phase.

    Where F counts steps within episodes, it is None until `full` epochs have passed. All worlds begin with a reset:
    until an episode's length has passed, F would be that of start states, which is often the highest of the training.

    Where F counts only whole episodes, and one has terminated early, F is None until `settled` epochs have passed.
    Until twice the length of an episode has passed, long episodes are missing among those that ended. A policy that
    seldom succeeds, but whose success ends the episode, would show the F of its successes only.

    Sums stay on the device until the epoch is closed.

    Args:
        lanes, worlds: L lanes of n worlds.
        window: epochs that F is averaged over.
        full: epochs until F is told where it counts steps within episodes; 0 tells it from the first.
        settled: epochs until F is told where episodes terminate early; 0 tells it from the first.
        components: (lane, name) of each reward component.

    Attributes:
        moments: (L, 6), sums of own and human reward over every transition so far, see `rewards.moments`.
    """

    def __init__(
        self,
        lanes: int,
        worlds: int,
        window: int = 1,
        *,
        full: int = 0,
        settled: int = 0,
        components: Sequence[tuple[int, str]] = (),
        device: torch.device | str = "cpu",
    ) -> None:
        self.lanes, self.worlds, self.components, self.device = lanes, worlds, components, device
        self.curves: list[dict[str, list[float | None]]] = [{} for _ in range(lanes)]
        self._scores: deque[Tensor] = deque(maxlen=window)
        self._full, self._settled = full, settled
        self._where = torch.zeros(lanes, 2, dtype=torch.float64, device=device)
        """(L, 2) weight in F so far: of steps that terminated an episode, and of steps that ended none."""
        self.moments = torch.zeros(lanes, 6, dtype=torch.float64, device=device)
        self._parts = torch.zeros(len(components), 4, dtype=torch.float64)
        """(components, 4), over the epochs closed with `parts`: a component's sum over all transitions, their number,
        and both for the transitions early in an episode."""
        self._lane_of = torch.tensor([lane for lane, _ in components], dtype=torch.int64)
        self._start()

    def _start(self) -> None:
        self._sums = torch.zeros(self.lanes, len(Sums._fields), dtype=torch.float64, device=self.device)
        """(L, 9): columns as in `Sums`, in one tensor, so that a step costs a GPU a single addition."""
        self._means = torch.zeros(len(self.components), 2, dtype=torch.float64, device=self.device)
        self._steps = 0

    def add(self, step: Step, own: Tensor, human: Tensor, means: Tensor, early: Tensor) -> None:
        """Add one step of all lanes: rewards (L, n), component means (components, 2) of `LaneRewards`, and `early`
        (N,), which is 1 for worlds that are early in an episode."""

        def per_lane(x: Tensor) -> Tensor:
            return x.view(self.lanes, self.worlds).double().sum(1)

        value, weight = step.score
        terms = Sums(
            value=value * weight,
            weight=weight,
            length=step.episode_length * step.ended,
            ended=step.ended,
            own=own,
            human=human,
            early=early,
            terminated=weight.masked_fill(~step.terminated, 0.0),
            elsewhere=weight.masked_fill(step.done, 0.0),
        )
        self._sums += torch.stack([per_lane(x) for x in terms], dim=-1)
        self.moments += moments(own, human)
        self._means += means
        self._steps += 1

    def close_epoch(self, *, parts: bool = False) -> tuple[list[float | None], list[float]]:
        """Append the epoch to every curve; returns F and the mean own reward per step of each lane.

        F is None where no episode was scored, and while a finite F waits for `full` or `settled`. A NaN or infinite F
        is returned at once; in the curve it is None.

        Args:
            parts: whether the epoch counts for `early_and_late`.
        """
        fitness, own_means = [], []
        sums = Sums(*self._sums.unbind(-1))
        self._scores.append(torch.stack((sums.value, sums.weight), dim=-1))
        scores = torch.stack(list(self._scores)).sum(0).tolist()
        self._where += torch.stack((sums.terminated, sums.elsewhere), dim=-1)
        waits = [self._waits(*where) for where in self._where.tolist()]
        components: list[dict[str, float | None]] = [{} for _ in range(self.lanes)]
        for (lane, name), (total, _) in zip(self.components, self._means.tolist(), strict=True):
            components[lane][COMPONENT + name] = _short(total / self._steps)
        if parts:
            every = torch.full((len(self.components),), float(self._steps * self.worlds), dtype=torch.float64)
            total, early = (self._means.cpu() * self.worlds).unbind(dim=-1)
            self._parts += torch.stack((total, every, early, sums.early.cpu()[self._lane_of]), dim=-1)
        for lane, row in enumerate(self._sums.tolist()):
            value, weight = scores[lane]
            one = Sums(*row)
            transitions = self._steps * self.worlds
            epoch = len(self.curves[lane].get("fitness", ()))
            looked = value / weight if weight else None
            # An F that is not finite is told at once, and stops the lane.
            if epoch + 1 < waits[lane] and math.isfinite(looked or 0.0):
                looked = None
            point: dict[str, float | None] = {
                "fitness": looked,
                "episode_length": one.length / one.ended if one.ended else None,
                "reward": one.own / transitions,
                "human_reward": one.human / transitions,
            }
            learnt: dict[str, float | None] = {f"ppo/{name}": None for name in STATISTICS}  # `learned` fills it in
            for name, number in (point | components[lane] | learnt).items():
                finite = number is not None and math.isfinite(number)
                self.curves[lane].setdefault(name, []).append(number if finite else None)
            fitness.append(point["fitness"])
            own_means.append(one.own / transitions)
        self._start()
        return fitness, own_means

    def _waits(self, terminated: float, elsewhere: float) -> int:
        """Epochs until F is told, given its weight on steps that terminated an episode and on steps that ended none."""
        if elsewhere:
            return self._full
        return self._settled if terminated else 0

    def learned(self, statistics: Tensor) -> None:
        """Add the PPO statistics (L, 5) of the update after the closed epoch; those that are not finite stay None."""
        for curves, row in zip(self.curves, statistics.tolist(), strict=True):
            for name, number in zip(STATISTICS, row, strict=True):
                if math.isfinite(number):
                    curves[f"ppo/{name}"][-1] = _short(number)

    def forget_parts(self) -> None:
        """Let no epoch so far count for `early_and_late`."""
        self._parts = torch.zeros_like(self._parts)

    def early_and_late(self, lane: int) -> dict[str, tuple[float | None]]:
        """Mean of each component early in episodes, and in the rest of them, as curves of one number; empty where no
        epoch counted."""
        found: dict[str, tuple[float | None]] = {}
        for (own, name), (total, every, early, first) in zip(self.components, self._parts.tolist(), strict=True):
            if own == lane and every:
                parts = {"early": (early, first), "late": (total - early, every - first)}
                for part, (value, count) in parts.items():
                    finite = count > 0 and math.isfinite(value)
                    found[f"component_{part}/{name}"] = (value / count if finite else None,)
        return found

    def lane_state(self, lane: int) -> dict[str, Any]:
        """All that is kept of a lane between two epochs; tensors are copied."""
        own = slice(lane, lane + 1)
        return {
            "curves": [self.curves[lane]],
            "scores": [scores[own].clone() for scores in self._scores],
            "where": self._where[own].clone(),
            "moments": self.moments[own].clone(),
            "parts": self._parts[self._lane_of == lane],
        }

    def load_lanes(self, lanes: Sequence[Mapping[str, Any]]) -> None:
        """Restore lanes with the same components, in new curves."""
        self.curves = [lane["curves"][0] for lane in lanes]
        self._scores.extend(torch.cat(epoch) for epoch in zip(*(lane["scores"] for lane in lanes), strict=True))
        self._where = torch.cat([lane.get("where", self._where[:1]) for lane in lanes])  # an older version saved none
        self.moments = torch.cat([lane["moments"] for lane in lanes])
        self._parts = torch.cat([lane["parts"].cpu() for lane in lanes])  # a state may be loaded onto the GPU

    def correlation(self, lane: int) -> float | None:
        """Pearson correlation of own and human reward over every transition so far."""
        return correlation(self.moments[lane])


def _short(value: float) -> float:
    """Rounded to six digits: only people read it, and a store of twenty lanes becomes half as large."""
    return float(f"{value:.6g}")
