"""The reward of each lane, computed on the same state."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..reward import graph
from ..tasks.task import State, Task
from ..types import RewardProgram


class LaneRewards:
    """Runs the reward programs of L lanes on their slices of the worlds.

    Args:
        task: the task whose human and sparse reward may be among the programs.
        programs: one per lane.
        worlds: worlds per lane, n.
        bonus: whether generated rewards get the task's success bonus.
    """

    def __init__(self, task: Task, programs: Sequence[RewardProgram], worlds: int, *, bonus: bool = False) -> None:
        self.task, self.worlds, self._bonus = task, worlds, bonus
        self.programs = [
            program if isinstance(program, str) else graph.compile(program, task.spec) for program in programs
        ]
        generated = [not isinstance(program, str) for program in self.programs]
        self._generated = torch.tensor(generated, dtype=torch.float32, device=task.device)[:, None]
        per_world = {variable.name for variable in task.spec.variables if variable.kind == "world"}
        self._sliced = [
            [name for name in program.inputs if name in per_world] if isinstance(program, graph.CompiledReward) else []
            for program in self.programs
        ]

    def __call__(self, state: State) -> tuple[Tensor, Tensor, list[dict[str, Tensor]]]:
        """Own reward (L, n), human reward (L, n) and the components of each lane, name to (n,)."""
        lanes, n = len(self.programs), self.worlds
        human = self.task.human_reward(state).view(lanes, n)
        own = human.clone()
        components: list[dict[str, Tensor]] = [{} for _ in range(lanes)]
        sparse = self.task.sparse_reward(state).view(lanes, n) if "sparse" in self.programs else None
        for lane, program in enumerate(self.programs):
            if isinstance(program, graph.CompiledReward):
                part = dict(state)
                for name in self._sliced[lane]:
                    part[name] = state[name][lane * n : (lane + 1) * n]
                part["num_envs"] = n
                own[lane], components[lane] = program(part, n)
            elif program == "sparse" and sparse is not None:
                own[lane] = sparse[lane]
        return own, human, components

    def bonus(self, state: State) -> Tensor | None:
        """What is added to the own rewards (L, n) before they train, outside of all curves and correlations."""
        bonus = self.task.success_bonus(state) if self._bonus else None
        return None if bonus is None else bonus.view(-1, self.worlds) * self._generated


def moments(own: Tensor, human: Tensor) -> Tensor:
    """Sums (L, 6) float64 over worlds that `correlation` needs: 1, x, y, x^2, y^2, xy."""
    x, y = own.double(), human.double()
    return torch.stack((torch.ones_like(x), x, y, x * x, y * y, x * y), dim=-1).sum(1)


def correlation(sums: Tensor) -> float | None:
    """Pearson correlation from the six sums of one lane; None when either side is constant or not finite."""
    count, x, y, xx, yy, xy = sums.tolist()
    spread_x, spread_y = xx - x * x / count, yy - y * y / count
    # Sums of squares cancel; what is left below this share of them is rounding.
    if not (spread_x > 1e-12 * xx and spread_y > 1e-12 * yy):
        return None
    return (xy - x * y / count) / (spread_x * spread_y) ** 0.5
