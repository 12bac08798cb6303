"""A lane that goes wrong is stopped, with the reason. The others train on as without it, to the bit."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable

import pytest
import torch

from openeureka.reward.validate import GraphError
from openeureka.suite.isaac.ant import Ant
from openeureka.tasks.env import Step
from openeureka.tasks.task import Score
from openeureka.training import rewards
from openeureka.training.population import Population
from openeureka.training.wire import pack_lanes, unpack_lanes
from openeureka.types import LaneSpec, Node, RewardGraph, TrainBudget, TrainingResult, TrainingState

HORIZON = 16
BUDGET = TrainBudget(env_steps=3 * HORIZON * 16, worlds=16)  # three epochs
SPEED = (Node("input", ("dof_vel",)), Node("select.int", ({"ref": 0}, 1, 0)))
"""Speed of the first joint: of Cartpole's cart, or of a leg of Ant, which has contacts."""


def program(*nodes: Node) -> RewardGraph:
    return RewardGraph(nodes=(*SPEED, *nodes), reward=1 + len(nodes), components=(("speed", 1),))


GOOD = program(Node("neg.default", ({"ref": 1},)))
BAD = {
    "not finite or beyond 1e6: NaN": program(Node("sqrt.default", ({"ref": 1},))),
    "not finite or beyond 1e6: absurd": program(Node("mul.Tensor", ({"ref": 1}, 1e30))),
    "failed with IndexError": program(
        Node("constant", ((1.0, 2.0), (2,), "float32")),
        Node("mul.Tensor", ({"ref": 1}, 1e6)),
        Node("_to_copy.default", ({"ref": 3},), {"dtype": "int64"}),
        Node("index.Tensor", ({"ref": 2}, ({"ref": 4},))),
    ),
}


def trained(env: str, bad: RewardGraph, prepare: Callable[[Population], None] = lambda population: None):
    specs = [LaneSpec(id="good", program=GOOD), LaneSpec(id="bad", program=bad, seed=1)]
    population = Population(env, specs, BUDGET, threads=1)
    prepare(population)
    good, other = (message for message in population.train() if isinstance(message, TrainingResult))
    return good, other


@functools.cache
def undisturbed(env: str) -> TrainingResult:
    return trained(env, GOOD)[0]


def assert_same_to_the_bit(result: TrainingResult, expected: TrainingResult) -> None:
    assert result.state is TrainingState.FINISHED
    assert dict(result.curves) == dict(expected.curves)
    assert result.best_reward is not None and expected.best_reward is not None
    assert result.best_reward.policy == expected.best_reward.policy
    assert result.correlation == expected.correlation


@pytest.mark.parametrize("env", ["cartpole", "ant"])
@pytest.mark.parametrize("fault", BAD)
def test_a_reward_that_fails_in_training_stops_its_own_lane_only(env: str, fault: str) -> None:
    good, bad = trained(env, BAD[fault])
    assert (bad.state, bad.env_steps) == (TrainingState.DIVERGED, HORIZON * 16)  # in the first epoch
    assert bad.message.startswith("stopped in epoch 1 of 3: the reward") and fault.split(":")[0] in bad.message
    assert_same_to_the_bit(good, undisturbed(env))


@pytest.mark.parametrize("env", ["cartpole", "ant"])
def test_a_policy_that_is_not_finite_stops_its_own_lane_only(env: str) -> None:
    def poison(population: Population) -> None:
        population.ppo.network.flat[1, 0] = float("inf")

    good, bad = trained(env, GOOD, poison)
    assert bad.message == "stopped in epoch 1 of 3: the policy was not finite"
    assert_same_to_the_bit(good, undisturbed(env))


@pytest.mark.parametrize("env", ["cartpole", "ant"])
def test_a_score_that_is_not_a_number_stops_its_own_lane_only(env: str) -> None:
    def spoil(population: Population) -> None:
        honest = population.env.step

        def step(actions: torch.Tensor) -> Step:
            done = honest(actions)
            lane = torch.arange(len(done.score.value)) // 16
            value = torch.where(lane == 1, torch.nan, done.score.value)
            return done._replace(score=Score(value, torch.where(lane == 1, 1.0, done.score.weight)))

        population.env.step = step

    good, bad = trained(env, GOOD, spoil)
    assert bad.message == "stopped in epoch 1 of 3: the task's score was not a finite number"
    assert (bad.fitness, bad.curves["fitness"], bad.best_fitness) == (None, (None,), None)
    assert_same_to_the_bit(good, undisturbed(env))


@pytest.mark.parametrize("speed", [2000.0, float("inf")])
def test_a_world_whose_physics_breaks_down_pays_nothing_and_no_bonus(
    speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Ant, "success_bonus", lambda task, s: torch.full((len(s["dof_vel"]),), 250.0))
    one_a_step = program(Node("mul.Tensor", ({"ref": 1}, 0.0)), Node("add.Tensor", ({"ref": 2}, 1.0)))
    budget = dataclasses.replace(BUDGET, bonus="original")
    population = Population("ant", [LaneSpec(id="one", program=one_a_step)], budget, threads=1)
    honest, qvel = population.env.step, population.env.sim.bind("qvel")

    def step(actions: torch.Tensor) -> Step:
        qvel[3] = speed
        population.env.sim.forward(torch.tensor([3]))
        return honest(actions)

    population.env.step = step
    (result,) = (message for message in population.train() if isinstance(message, TrainingResult))
    assert result.curves["reward"] == (15 / 16,) * 3
    assert population.env.bad_total == 3 * HORIZON
    paid = population.rollout.reward[0]
    assert paid[3].tolist() == [0.0] * HORIZON and float(paid[4:].min()) > 0.0


def test_rewards_are_judged_before_they_are_scaled() -> None:
    """Cartpole scales rewards by 0.1: 5e6 a step is above the limit of 1e6, although the scaled reward is below it."""
    constant = (Node("mul.Tensor", ({"ref": 1}, 0.0)), Node("add.Tensor", ({"ref": 2}, 5e6)))
    _, bad = trained("cartpole", program(*constant))
    assert bad.state is TrainingState.DIVERGED


def test_a_graph_that_was_tampered_with_never_reaches_training() -> None:
    forged = program(Node("from_file.default", ("/etc/hostname",)))
    with pytest.raises(GraphError, match=r"node 2: operation 'from_file\.default' is not allowed"):
        unpack_lanes(pack_lanes("cartpole", [LaneSpec(id="x", program=forged)], BUDGET))


def test_a_lane_whose_reward_takes_too_long_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rewards, "MAX_CALL_SECONDS", 0.0)
    good, other = trained("cartpole", GOOD)
    assert good.state is other.state is TrainingState.DIVERGED
    assert re.search(r"the reward took \d+\.\d s for one step", other.message)
