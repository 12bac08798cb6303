"""Policies with discrete choices: the categorical head by hand, and lanes that learn what they would learn alone."""

import math

import numpy as np
import onnxruntime
import pytest
import torch

from openeureka.report import export
from openeureka.tasks.choices import chosen, indices
from openeureka.tasks.task import Recipe
from openeureka.training.heads import Categorical
from openeureka.training.policy import Player, Policy
from openeureka.training.ppo import PPO, Rollout

CPU = torch.device("cpu")
CHOICES = (2, 3)
RECIPE = Recipe(hidden=(8,), env_steps=0, epochs=2, minibatches=2, entropy_coef=0.01)
NONE = torch.zeros(1, 1, 0)


def test_of_each_choice_the_greatest_is_taken():
    preferences = torch.tensor([[0.1, 0.2, 3.0, -1.0, 2.0], [5.0, 5.0, 0.0, 1.0, 2.0]])
    assert indices(preferences, CHOICES).tolist() == [[1, 0], [0, 2]]
    assert chosen(preferences, CHOICES).tolist() == [[0, 1, 1, 0, 0], [1, 0, 0, 0, 1]]


def test_probabilities_by_hand():
    head = Categorical(CHOICES)
    # Odds 1 : 3 in the first choice, 1 : 1 : 2 in the second.
    output = torch.tensor([[[0.0, math.log(3.0), 0.0, 0.0, math.log(2.0)]]])
    action = torch.tensor([[[0.0, 1.0, 0.0, 0.0, 1.0]]])
    assert float(head.log_prob(output, NONE, action).exp()) == pytest.approx(3 / 4 * 1 / 2)
    entropy = -(0.25 * math.log(0.25) + 0.75 * math.log(0.75)) + 1.5 * math.log(2.0)
    assert float(head.entropy(output, NONE)) == pytest.approx(entropy)
    even = torch.zeros(1, 1, 5)
    # KL(new || uniform) is log 2 + log 3, the entropy of the uniform policy, minus the entropy.
    expected = math.log(2.0) + math.log(3.0) - entropy
    assert float(head.divergence(output, NONE, even, NONE)) == pytest.approx(expected, rel=1e-5)
    assert float(head.divergence(output, NONE, output, NONE)) == pytest.approx(0.0, abs=1e-6)


def test_samples_come_as_often_as_their_probabilities_say():
    head, generator = Categorical((3,)), torch.Generator().manual_seed(0)
    output = torch.tensor([[0.0, math.log(2.0), math.log(5.0)]]).expand(1, 8000, 3)
    action, log_prob = head.sample(output, NONE, head.noise((8000, 3), generator))
    assert action.sum(-1).eq(1.0).all()
    np.testing.assert_allclose(action[0].mean(0), [1 / 8, 2 / 8, 5 / 8], atol=0.02)
    torch.testing.assert_close(log_prob.exp()[0, :1], (action[0, :1] * torch.tensor([1, 2, 5]) / 8).sum(-1))


def filled(ppo: PPO, lanes: int) -> tuple[Rollout, torch.Tensor]:
    """Four steps of six worlds with three observations. The reward is 1 for option 1 of the first choice, else 0."""
    generator = torch.Generator().manual_seed(0)
    rollout = Rollout(lanes, 6, 4, 3, 5, CPU)
    for t in range(4):
        observation = torch.randn(6, 3, generator=generator).expand(lanes, -1, -1)
        step = ppo.act(observation)
        rollout.store(t, observation, step, step.action[..., 1], torch.zeros(lanes, 6))
    return rollout, torch.zeros(lanes, 6)


def test_a_lane_learns_the_same_beside_others_and_learns_what_is_paid():
    alone, beside = PPO([5], 3, 5, RECIPE, CPU, CHOICES), PPO([5, 9], 3, 5, RECIPE, CPU, CHOICES)
    for _ in range(60):
        alone.update(*filled(alone, 1))
        beside.update(*filled(beside, 2))
    torch.testing.assert_close(alone.network.flat[0], beside.network.flat[0], rtol=1e-3, atol=1e-4)
    assert float(alone.act(torch.zeros(1, 200, 3)).action[..., 1].mean()) > 0.8
    assert float(alone.statistics[0, 3]) < math.log(2.0) + math.log(3.0)  # entropy


def test_a_policy_file_says_its_choices_and_plays_the_same_elsewhere():
    ppo = PPO([3], 4, 5, RECIPE, CPU, CHOICES)
    policy = Policy.from_bytes(Policy.of("toy", ppo, 0).to_bytes())
    policy.expect(4, 5)
    assert policy.choices == CHOICES and "log_std" not in policy.tensors
    observation = torch.randn(50, 4, generator=torch.Generator().manual_seed(0))
    played = Player([policy])(observation)
    session = onnxruntime.InferenceSession(export.to_onnx(policy))
    (index,) = session.run(["action"], {"observation": observation.numpy()})
    assert index.dtype == np.int64
    np.testing.assert_array_equal(index, indices(played, CHOICES).numpy())
