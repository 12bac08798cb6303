"""The conformance suite itself: each task below breaks one of its rules, and the check of that rule must fail."""

from typing import Any

import pytest
import torch
from torch import Tensor

from openeureka.errors import TaskError
from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make
from openeureka.tasks.task import Score, State, mean_over_steps
from openeureka.testing.conformance.task import TaskConformance


class SharedMemory(Cartpole):
    def compute_state(self) -> dict[str, Any]:
        return super().compute_state() | {"dof_pos": self.qpos}


class WrongShape(Cartpole):
    def compute_state(self) -> dict[str, Any]:
        return super().compute_state() | {"actions": self.actions.squeeze(-1)}


class Undeclared(Cartpole):
    def compute_state(self) -> dict[str, Any]:
        return super().compute_state() | {"secret": self.qpos.clone()}


class GlobalNoise(Cartpole):
    def reset(self, worlds: Tensor) -> None:
        self.qpos[worlds] = 0.1 * torch.randn(len(worlds), 2)


class ForgetfulReset(Cartpole):
    def reset(self, worlds: Tensor) -> None:
        super().reset(torch.arange(self.num_envs))


class Forgotten(Cartpole):
    """Remembers something of each world that `memory` does not list."""

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.falls = torch.zeros(self.num_envs)

    def reset(self, worlds: Tensor) -> None:
        super().reset(worlds)
        self.falls[worlds] = 0.0


class Levels(Cartpole):
    """Each step raises a world's level, which decides where its next episode starts. `memory` does not list it."""

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.level = torch.zeros(self.num_envs)

    def outcome(self, s: State) -> Tensor:
        self.level = self.level + 1.0
        return self.level

    def reset(self, worlds: Tensor) -> None:
        super().reset(worlds)
        self.qpos[worlds, 0] += 0.01 * self.level[worlds]


class Remembered(Levels):
    memory = ("level",)


class InfiniteReward(Cartpole):
    def human_reward(self, s: State) -> Tensor:
        return 1.0 / torch.zeros_like(s["pole_angle"])


class MixedFitness(Cartpole):
    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_steps(s["pole_angle"] - s["pole_angle"].mean())


class MixedEnd(Cartpole):
    def terminated(self, s: State) -> Tensor:
        return s["pole_angle"].abs() > s["pole_angle"].abs().mean()


class MixedHuman(Cartpole):
    def human_reward(self, s: State) -> Tensor:
        return s["pole_angle"] - s["pole_angle"].mean()


class MixedSparse(Cartpole):
    def sparse_reward(self, s: State) -> Tensor:
        return s["pole_angle"] / s["pole_angle"].abs().max()


class MixedHistory(Cartpole):
    """Its F depends on how long the episodes of all worlds have lasted."""

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_steps(s["pole_angle"] + self.progress.float().mean())


class Talkative(Cartpole):
    def observe(self, s: State) -> Tensor:
        """The reward is paid for an upright pole."""
        return super().observe(s)


@pytest.mark.parametrize(
    ("task", "check"),
    [
        (SharedMemory, "test_recorded_values_do_not_change_when_the_simulation_goes_on"),
        (WrongShape, "test_state_variables_are_those_of_the_spec"),
        (Undeclared, "test_state_variables_are_those_of_the_spec"),
        (GlobalNoise, "test_worlds_of_equal_seed_live_equal_lives_and_others_do_not"),
        (ForgetfulReset, "test_a_broken_world_is_reset_and_counted_and_leaves_the_others_alone"),
        (MixedFitness, "test_a_world_is_judged_by_itself"),
        (MixedEnd, "test_a_world_is_judged_by_itself"),
        (MixedHuman, "test_a_world_is_judged_by_itself"),
        (MixedSparse, "test_a_world_is_judged_by_itself"),
        (MixedHistory, "test_a_broken_world_is_reset_and_counted_and_leaves_the_others_alone"),
        (Forgotten, "test_a_reset_by_mask_is_a_reset_by_index"),
        (Levels, "test_another_environment_goes_on_from_a_saved_state"),
        (InfiniteReward, "test_fitness_and_rewards_are_finite_numbers_per_world"),
        (Talkative, "test_the_context_shows_the_motion_and_hides_the_goal"),
    ],
)
def test_a_broken_promise_is_noticed(task: type[Cartpole], check: str):
    suite = TaskConformance()
    suite.env = f"{__name__}:{task.__name__}"
    with pytest.raises((AssertionError, TaskError)):  # the environment itself finds some faults
        getattr(suite, check)()


def test_what_a_reset_writes_and_memory_does_not_list_is_named():
    with pytest.raises(TaskError, match=r"`reset` writes `falls`, which `memory` does not list"):
        make(f"{__name__}:Forgotten", worlds=2).reset()
    remembered = type("Remembered", (Forgotten,), {"memory": ("falls",)})
    BatchedEnv(remembered, worlds=2).reset()
    misspelt = type("Misspelt", (Forgotten,), {"memory": ("fals",)})
    with pytest.raises(
        TaskError, match=r"`memory` of the task `cartpole` lists `fals`, but `self\.fals` is not a tensor"
    ):
        BatchedEnv(misspelt, worlds=2).reset()


def test_what_lives_on_is_kept_where_memory_lists_it():
    suite = TaskConformance()
    suite.env = f"{__name__}:Remembered"
    suite.test_another_environment_goes_on_from_a_saved_state()


class Counting(Cartpole):
    """Its `outcome` is the number of steps of the episode so far."""

    memory = ("count",)

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.count = torch.zeros(self.num_envs)

    def reset(self, worlds: Tensor) -> None:
        super().reset(worlds)
        self.count[worlds] = 0.0

    def outcome(self, s: State) -> Tensor:
        self.count = self.count + 1.0
        return self.count

    def sparse_reward(self, s: State) -> Tensor:
        return s["outcome"]


@pytest.mark.parametrize("masked", [False, True])
def test_the_outcome_of_a_step_outlives_the_reset_that_follows(masked: bool):
    env = BatchedEnv(Counting, worlds=2)
    env.masked = masked
    env.reset()
    env.step(torch.zeros(2, 1))
    env.task.progress[0] = env.task.time_limit() - 1
    step = env.step(torch.zeros(2, 1))
    assert step.done.tolist() == [True, False]
    assert env.task.sparse_reward(step.state).tolist() == [2.0, 2.0]
    assert env.task.sparse_reward(env.step(torch.zeros(2, 1)).state).tolist() == [1.0, 3.0]
