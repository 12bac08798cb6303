"""The benchmark's task is Gymnasium's environment, step by step."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch

gymnasium = pytest.importorskip("gymnasium")


def test_states_rewards_and_observations_are_those_of_gymnasium(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    from openeureka.tasks import registry

    ours = registry.make("gym_ant:GymAnt", worlds=1, threads=1)
    ours.reset()
    theirs = gymnasium.make("Ant-v5").unwrapped
    theirs.reset(seed=0)
    # Neither simulator's warm start is part of the state: a first step with both at rest in the air needs none.
    theirs.set_state(theirs.init_qpos, theirs.init_qvel)
    ours.task.qpos[0] = torch.from_numpy(theirs.init_qpos).float()
    ours.task.qvel[0] = 0.0
    ours.sim.forward(torch.tensor([0]))
    random = np.random.default_rng(0)
    for _ in range(10):
        action = random.uniform(-1.0, 1.0, 8).astype(np.float32)
        observation, reward, terminated, _, info = theirs.step(action)
        step = ours.step(torch.from_numpy(action)[None])
        # 13 of pose, 14 of velocity; contact wrenches after them lag one of five substeps.
        np.testing.assert_allclose(step.observation[0, :27], observation[:27], atol=2e-3)
        # Gymnasium's velocity is that of body frames, which lag one of five substeps: compare the rest of the reward.
        rest = ours.task.human_reward(step.state) - step.state["velocity"]
        assert float(rest[0]) == pytest.approx(reward - info["x_velocity"], abs=0.02)  # contact cost lags too
        assert float(step.state["velocity"][0]) == pytest.approx(info["x_velocity"], abs=0.3)
        assert bool(step.terminated[0]) == terminated
    assert float(np.abs(observation[27:]).max()) > 0.0  # it has landed
    assert float(step.observation[0, 27:].abs().max()) > 0.0
    sys.modules.pop("gym_ant")
