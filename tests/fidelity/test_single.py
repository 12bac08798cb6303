"""Each Isaac task, and the pen in one hand, against its original on given states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import torch

from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make

from .raw import Array, Worlds, differences, prepared, put, same_signs
from .single import PUBLISHED, N, Published

QUATERNIONS = ("rot", "quats", "pose", "state", "states", "tensor")


@dataclass(frozen=True)
class Case:
    env: str
    published: Published
    simulation: BatchedEnv
    found: Mapping[str, Any]
    expected: Mapping[str, Any]


@pytest.fixture(scope="module", params=PUBLISHED)
def case(request: pytest.FixtureRequest) -> Case:
    """Nine worlds in states that span what ends an episode, what is rewarded, and what F counts."""
    env = request.param
    published, simulation = PUBLISHED[env], prepared(env, worlds=N)
    before = Worlds(simulation)
    simulation.step(torch.rand(N, simulation.task.num_actions, generator=torch.Generator().manual_seed(8)) * 2 - 1)
    put(simulation, published.poses(Worlds(simulation)))
    expected = published.state(Worlds(simulation), simulation.task, before)
    expected = {name: value.double().numpy() if isinstance(value, torch.Tensor) else value for name, value in
                expected.items()}  # fmt: skip
    return Case(env, published, simulation, simulation.current_state(), expected)


def test_state_variables_are_the_originals(case: Case) -> None:
    # Contact forces come from an iterative solver, an angle near pi depends steeply on its sine, and float32 resolves
    # potentials of 60,000 to 4e-3.
    loose = {"vec_sensor_tensor": 1e-2, "contact_forces": 1e-2, "sensor_forces": 1e-2, "sensor_torques": 1e-2,
             "dof_force_tensor": 1e-4, "torques": 1e-4, "rotation_distance": 1e-3, "table_tilt": 1e-4}  # fmt: skip
    assert differences(case.simulation.task.spec, case.found, case.expected, loose) == []


def doubled(case: Case) -> dict[str, Array]:
    """The variables found, as doubles: observation and reward are computed from these float32 values, so the expected
    ones are, too."""
    return {
        name: value.double().numpy() if isinstance(value, torch.Tensor) else value for name, value in case.found.items()
    }


def test_the_observation_is_the_originals(case: Case) -> None:
    found = case.found["obs_buf"].double().numpy()
    expected = case.published.observe(doubled(case))
    assert found.shape == expected.shape == (N, case.simulation.task.num_observations)
    away = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
    assert away.max() < 1e-4, f"column {away.max(axis=0).argmax()}"


def as_state(case: Case, variant: Mapping[str, Array], original: Mapping[str, Array]) -> dict[str, Any]:
    changed = {name: value for name, value in variant.items() if value is not original[name]}
    return {**case.found, **{name: torch.from_numpy(value).float() for name, value in changed.items()}}


def test_reward_reset_and_f_are_the_originals(case: Case) -> None:
    task, ended = case.simulation.task, torch.arange(N) % 2 == 0
    original = doubled(case)
    failures, parts, rewards = [], [], []
    edges = [{**original, **edge} for f in (0.97, 1.03) for edge in case.published.edges(original, f)]
    for variant in [*case.published.variants(original), *edges]:
        s = as_state(case, variant, original)
        reward, failed, part = case.published.judge(variant)
        # A speed is the difference of two potentials, each rounded to 4e-3 in float32.
        away = 1e-3 if "potentials" in s else 2e-4
        assert task.human_reward(s).tolist() == pytest.approx(reward.tolist(), rel=2e-4, abs=away)
        assert task.terminated(s).tolist() == failed.tolist()
        assert task.sparse_reward(s).tolist() == pytest.approx(part.tolist(), rel=2e-4, abs=2e-4)
        failures += failed.tolist()
        parts += part.tolist()
        rewards += reward.tolist()
    assert set(failures) == {True, False}
    assert len(set(parts)) >= 2 and len(set(rewards)) > N // 2
    value, weight = task.fitness(case.found, ended)
    part, progress = case.published.judge(original)[2], task.progress.double().numpy()
    if case.env in ("cartpole", "ballbalance"):  # the length of the episodes that end
        assert value.tolist() == progress.tolist() and weight.tolist() == ended.float().tolist()
    elif case.env == "franka_cabinet":  # the share of successes, each as heavy as an episode that times out
        won = (part > 0) & ended.numpy()
        assert weight.tolist() == np.where(won, 500 - progress, 1).tolist()
        assert (value * weight).tolist() == pytest.approx(np.where(won, 499, 0).tolist())
    elif case.published.reached:  # the goals of the episodes that end
        goals = task.tensors()["goals_reached"].double().numpy()
        assert value.tolist() == (goals + part).tolist() and weight.tolist() == ended.float().tolist()
    else:  # a mean over all steps
        assert value.tolist() == pytest.approx(part.tolist(), rel=2e-4, abs=2e-4)
        assert weight.tolist() == [1.0] * N


def test_an_episode_times_out_where_the_original_does(case: Case) -> None:
    assert case.simulation.task.time_limit() == case.published.steps  # what follows from it, TaskConformance checks


def test_a_reached_goal_is_counted_once_and_replaced() -> None:
    """12 waypoints of 30 degrees about the pen's own y axis bring the goal of Spin back to where it was."""
    simulation = make("shadow_hand_spin", worlds=1, threads=1)
    simulation.reset()
    first = simulation.current_state()["goal_rot"].double().numpy()
    for count in range(1, 13):
        goal = simulation.current_state()["goal_rot"].double().numpy()
        put(simulation, {"object": np.concatenate(([[0, -0.39, 0.48]], goal), axis=1)})
        simulation.task.progress[:] = 1
        simulation.step(torch.zeros(1, simulation.task.num_actions))
        assert simulation.task.tensors()["goals_reached"].tolist() == [count]
    last = simulation.current_state()["goal_rot"].double().numpy()
    assert np.abs(same_signs(last, first) - first).max() < 1e-5
