"""Policies that see only what a robot can measure, with a critic that sees everything."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.report import export
from openeureka.suite.isaac.ant import Ant
from openeureka.suite.isaac.anymal import Anymal
from openeureka.suite.isaac.humanoid import Humanoid
from openeureka.training.network import StackedActorCritic
from openeureka.training.policy import Player, Policy
from openeureka.training.population import Population
from openeureka.training.ppo import PPO
from openeureka.types import LaneSpec, TrainBudget, TrainingResult

onnxruntime = pytest.importorskip("onnxruntime", reason="plays policy.onnx; comes with the extra dev")
UNSEEN = (0, 1, 2)


def network(unseen: tuple[int, ...] = ()) -> StackedActorCritic:
    return StackedActorCritic([3, 4], 6, 2, (8, 8), torch.device("cpu"), unseen=unseen)


def test_actions_do_not_depend_on_what_is_unseen_and_values_do() -> None:
    x = torch.randn(2, 5, 6)
    other = x.clone()
    other[..., :3] += 1.0
    found = network(UNSEEN)
    torch.testing.assert_close(found(x).mean, found(other).mean, rtol=0, atol=0)
    assert not torch.allclose(found(x).value, found(other).value)
    assert "critic_w0" not in network().parameters


def test_training_leaves_the_weights_of_what_is_unseen_at_zero() -> None:
    spec = [LaneSpec(id="a", program="human"), LaneSpec(id="b", program="human", seed=1)]
    population = Population(
        "anymal", spec, TrainBudget(env_steps=24 * 4 * 2, worlds=4, observe="measurable"), threads=1
    )
    before = {name: value.clone() for name, value in population.ppo.network.parameters.items()}
    results = [event for event in population.train() if isinstance(event, TrainingResult)]
    now = population.ppo.network.parameters
    assert not now["w0"][:, :3].any() and now["w0"][:, 3:].ne(before["w0"][:, 3:]).any()
    assert now["critic_w0"][:, :3].ne(before["critic_w0"][:, :3]).any()
    policy = Policy.from_bytes(results[0].last or b"")
    assert policy.unseen == UNSEEN
    assert policy.interface["control_rate"] == "50.0" and policy.interface["action_scale"].startswith("0.5,0.5,")
    # A lane that starts from this policy has its critic too.
    started = PPO([5], 48, 12, Anymal.recipe, torch.device("cpu"), unseen=UNSEEN)
    policy.put(started, 0)
    torch.testing.assert_close(started.network.parameters["critic_head_w"][0], policy.tensors["critic_head_w"])
    deployed(policy)


def deployed(policy: Policy) -> None:
    """The file for the robot lacks the linear velocity, and acts as the policy does here."""
    files = export.deployed(policy, Anymal)
    session = onnxruntime.InferenceSession(files["policy.onnx"])
    said = session.get_modelmeta().custom_metadata_map
    assert said["observation_names"].split(",")[0] == "base_angular_velocity"
    assert sum(map(int, said["observation_sizes"].split(","))) == len(said["observation_scales"].split(",")) == 45
    x = torch.randn(4, 48)
    (action,) = session.run(["action"], {"observation": x[:, 3:].numpy()})
    np.testing.assert_allclose(action, Player([policy])(x).numpy(), atol=1e-5)


def test_legged_tasks_drop_the_base_s_linear_velocity() -> None:
    assert Anymal.unseen("measurable") == UNSEEN and Anymal.unseen("all") == ()
    assert Ant.unseen("measurable") == Humanoid.unseen("measurable") == (0, 1, 2, 3)
    assert {"torso_velocity", "torso_height"} == {name for name, _ in Ant.unmeasured}


def test_a_setting_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match="`observe` must be one of all, measurable"):
        RunConfig(observe="some")
