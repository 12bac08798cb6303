import dataclasses
import math

import numpy as np
import pytest
import torch

from openeureka.tasks.task import Recipe
from openeureka.training.network import RunningNorm, StackedActorCritic
from openeureka.training.ppo import PPO, STATISTICS, Rollout, advantages

CPU = torch.device("cpu")
RECIPE = Recipe(hidden=(8, 4), env_steps=0, epochs=2, minibatches=2)


def rollout_of(lanes: int, worlds: int, horizon: int, observations: int = 3, actions: int = 2) -> Rollout:
    return Rollout(lanes, worlds, horizon, observations, actions, CPU)


def test_advantages_by_hand():
    rollout = rollout_of(1, 2, 3)
    rollout.reward[0] = torch.tensor([[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]])
    rollout.value[0] = torch.tensor([[0.5, 1.0, 1.5], [2.0, 2.0, 2.0]])
    rollout.done[0] = torch.tensor([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    last = torch.tensor([[2.0, 4.0]])
    result = advantages(rollout, last, gamma=0.5, lam=0.5)[0]
    # World 0: d2 = 3 + .5*2 - 1.5 = 2.5; d1 = 2 + .5*1.5 - 1 = 1.75, a1 = 1.75 + .25*2.5 = 2.375;
    #          d0 = 1 + .5*1 - .5 = 1, a0 = 1 + .25*2.375 = 1.59375.
    # World 1: d2 = 1 + .5*4 - 2 = 1; step 1 ends an episode: a1 = 1 - 2 = -1; d0 = 1 + .5*2 - 2 = 0, a0 = -.25.
    expected = torch.tensor([[1.59375, 2.375, 2.5], [-0.25, -1.0, 1.0]])
    assert torch.equal(result, expected)


def test_statistics_agree_with_numpy_over_everything_seen():
    norm = RunningNorm(2, 3, CPU)
    batches = [torch.randn(2, size, 3) * 4 + 7 for size in (5, 1, 400)]
    for batch in batches:
        norm.update(batch)
    for lane in range(2):
        # The statistics start as those of one sample of mean 0 and variance 1.
        seen = np.concatenate([batch[lane].numpy() for batch in batches]).astype(np.float64)
        mean = seen.sum(0) / (len(seen) + 1)
        second = ((seen**2).sum(0) + 1.0) / (len(seen) + 1)
        np.testing.assert_allclose(norm.mean[lane, 0], mean, rtol=1e-5)
        np.testing.assert_allclose(norm.var[lane, 0], second - mean**2, rtol=1e-4)
    x = batches[2][:, :50]
    torch.testing.assert_close(norm.denormalize(norm.normalize(x)), x, rtol=1e-3, atol=1e-2)


def test_a_stack_of_networks_computes_what_each_would_alone():
    stack = StackedActorCritic([1, 2, 1], 3, 2, (8, 4), CPU)
    x = torch.randn(3, 10, 3)
    together = stack(x)
    assert torch.equal(stack.flat[0], stack.flat[2]) and not torch.equal(stack.flat[0], stack.flat[1])
    for lane, seed in enumerate([1, 2, 1]):
        alone = StackedActorCritic([seed], 3, 2, (8, 4), CPU)(x[lane : lane + 1])
        torch.testing.assert_close(together.mean[lane], alone.mean[0])
        torch.testing.assert_close(together.value[lane], alone.value[0])


def test_first_actions_are_as_large_and_as_noisy_as_the_recipe_says():
    x = torch.ones(1, 2000, 4)
    whole, small = (
        PPO([0], 4, 2, dataclasses.replace(RECIPE, head=head, noise=0.25), CPU).act(x) for head in (1.0, 0.01)
    )
    torch.testing.assert_close(small.mean, 0.01 * whole.mean)
    torch.testing.assert_close(small.value, whole.value)
    torch.testing.assert_close(small.action.std(1), torch.full((1, 2), 0.25), rtol=0.1, atol=0.0)


def test_updating_flat_moves_every_parameter():
    network = StackedActorCritic([0], 3, 2, (8,), CPU)
    before = {name: value.detach().clone() for name, value in network.parameters.items()}
    network.flat.add_(1.0)
    for name, value in network.parameters.items():
        torch.testing.assert_close(value.detach(), before[name] + 1.0)


def filled(lanes: int, seed: int = 0) -> tuple[Rollout, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    rollout = rollout_of(lanes, 6, 4)
    for name in ("observation", "action", "mean", "log_prob", "value", "reward"):
        tensor = getattr(rollout, name)
        tensor.copy_(torch.randn(tensor.shape[1:], generator=generator).expand_as(tensor))
    rollout.log_prob -= 3.0
    return rollout, torch.zeros(lanes, 6)


def test_the_learning_rate_follows_the_divergence():
    ppo = PPO([0, 1, 2], 3, 2, RECIPE, CPU)
    before = ppo.learning_rate.clone()
    threshold = RECIPE.kl_threshold
    ppo.adapt(torch.tensor([[3 * threshold], [threshold], [0.1 * threshold]]))
    torch.testing.assert_close(ppo.learning_rate / before, torch.tensor([[1 / 1.5], [1.0], [1.5]]))


def test_a_gradient_is_clipped_per_lane():
    recipe = dataclasses.replace(RECIPE, max_grad_norm=1.0)
    ppo = PPO([0, 0], 3, 2, recipe, CPU)
    gradient = torch.zeros_like(ppo.network.flat)
    gradient[0, 0], gradient[1, 0] = 100.0, 0.5
    ppo.descend(gradient)
    first = torch.cat([ppo.lane_state(lane)["moments"][0] for lane in range(2)])
    torch.testing.assert_close(first[:, 0], torch.tensor([0.1, 0.05]), rtol=1e-4, atol=0)


def test_a_lane_learns_the_same_beside_others():
    alone, beside = PPO([5], 3, 2, RECIPE, CPU), PPO([5, 9], 3, 2, RECIPE, CPU)
    for ppo, lanes in ((alone, 1), (beside, 2)):
        ppo.update(*filled(lanes))
        ppo.update(*filled(lanes, seed=1))
    torch.testing.assert_close(alone.network.flat[0], beside.network.flat[0], rtol=1e-4, atol=1e-6)
    torch.testing.assert_close(alone.observations.mean[0], beside.observations.mean[0])


def test_a_poisoned_lane_leaves_the_others_bit_identical():
    healthy, poisoned = PPO([5, 9], 3, 2, RECIPE, CPU), PPO([5, 9], 3, 2, RECIPE, CPU)
    rollout, last = filled(2)
    healthy.update(rollout, last)
    rollout, last = filled(2)
    rollout.reward[1] = float("nan")
    poisoned.update(rollout, last)
    assert torch.equal(healthy.network.flat[0], poisoned.network.flat[0])
    assert not torch.isfinite(poisoned.network.flat[1]).all()


def test_a_frozen_lane_does_not_move():
    ppo = PPO([5, 9], 3, 2, RECIPE, CPU)
    ppo.active[1] = False
    before = ppo.network.flat.clone()
    ppo.update(*filled(2))
    assert torch.equal(before[1], ppo.network.flat[1])
    assert not torch.equal(before[0], ppo.network.flat[0])


def test_values_where_asked_are_the_values_there():
    ppo = PPO([5, 9, 2], 3, 2, RECIPE, CPU)
    observation = torch.randn(3, 6, 3, generator=torch.Generator().manual_seed(0))
    where = torch.tensor([[0, 1, 0, 0, 1, 1], [0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]]).bool()
    expected = ppo.value(observation) * where
    assert expected.abs().sum() > 0
    torch.testing.assert_close(ppo.value_where(observation, where), expected)
    assert not ppo.value_where(observation, torch.zeros_like(where)).any()


def test_a_value_where_asked_does_not_depend_on_how_much_is_asked_of_other_lanes():
    ppo = PPO([5, 9], 300, 2, dataclasses.replace(RECIPE, hidden=(128, 64)), CPU)
    generator = torch.Generator().manual_seed(0)
    observation = torch.randn(2, 256, 300, generator=generator)
    few = torch.rand(2, 256, generator=generator) < 0.05
    for share in (0.0, 0.1, 0.5, 1.0):
        others = few.clone()
        others[1] = torch.rand(256, generator=generator) < share
        assert torch.equal(ppo.value_where(observation, others)[0], ppo.value_where(observation, few)[0])


@pytest.mark.parametrize("seeds", [[3, 3], [3, 4]])
def test_lanes_of_equal_seed_explore_alike(seeds: list[int]):
    action = PPO(seeds, 3, 2, RECIPE, CPU).act(torch.ones(2, 7, 3)).action
    assert torch.equal(action[0], action[1]) == (seeds[0] == seeds[1])


def test_log_probabilities_are_those_of_the_gaussian():
    ppo = PPO([0], 3, 2, RECIPE, CPU)
    ppo.network.flat += 0.1  # log_std becomes 0.1
    step = ppo.act(torch.randn(1, 5, 3))
    normal = torch.distributions.Normal(step.mean, torch.full((2,), 0.1).exp())
    torch.testing.assert_close(step.log_prob, normal.log_prob(step.action).sum(-1))


def test_statistics_of_an_update_by_hand():
    ppo = PPO([5, 9], 3, 2, dataclasses.replace(RECIPE, epochs=1, minibatches=1, max_grad_norm=None), CPU)
    ppo.active[1] = False
    assert ppo.statistics.isnan().all(), "there are no statistics before the first update"
    rollout, last = filled(2)
    step = ppo.act(rollout.observation[:, :, 0])
    for t in range(4):
        rollout.store(t, rollout.observation[:, :, 0].clone(), step, rollout.reward[:, :, t], rollout.done[:, :, t])
    rate = float(ppo.learning_rate[0])
    value = ppo.network(ppo.observations.normalize(rollout.observation.flatten(1, 2))).value[0].detach()
    ppo.update(rollout, last)
    told = dict(zip(STATISTICS, ppo.statistics[0].tolist(), strict=True))
    # The policy is still the one that acted. Every ratio is 1, so the loss is minus the mean of normalised advantages,
    # which is 0. The KL divergence is 0, so the learning rate grows by half.
    assert told["surrogate_loss"] == pytest.approx(0.0, abs=1e-5) and told["kl"] == pytest.approx(0.0, abs=1e-5)
    assert told["learning_rate"] == pytest.approx(1.5 * rate)
    # Two actions have 0.5 + 0.5 log(2 pi) + log std each. Adam's first step moves log std by the rate at most.
    assert told["entropy"] == pytest.approx(1.0 + math.log(2 * math.pi), abs=2.01 * told["learning_rate"])
    # The value loss is the larger of the clipped and the unclipped square. The statistics include the targets.
    returns = advantages(rollout, last, ppo.recipe.gamma, ppo.recipe.gae_lambda) + rollout.value
    target, old = (ppo.values.normalize(x.reshape(2, -1, 1))[0, :, 0] for x in (returns, rollout.value))
    near = old + (value - old).clamp(-ppo.recipe.clip, ppo.recipe.clip)
    expected = torch.maximum((value - target) ** 2, (near - target) ** 2).mean()
    assert told["value_loss"] == pytest.approx(float(expected), rel=1e-4)
    assert ppo.statistics[1].isnan().all(), "a frozen lane learns nothing"


def test_what_a_changed_policy_diverged_by_is_told():
    ppo = PPO([5], 3, 2, dataclasses.replace(RECIPE, epochs=8, learning_rate=1e-3), CPU)
    ppo.update(*filled(1))
    told = dict(zip(STATISTICS, ppo.statistics[0].tolist(), strict=True))
    assert told["kl"] > 0 and told["value_loss"] > 0
