import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

from openeureka.report import export
from openeureka.tasks import registry
from openeureka.training.policy import Player, Policy

from .policies import policy

onnxruntime = pytest.importorskip("onnxruntime", reason="checks policy.onnx; comes with the extra dev")


@pytest.mark.parametrize("shape", [(4, 1, (32, 32)), (60, 8, (64, 32, 16)), (3, 2, (8,))])
def test_the_file_acts_as_the_policy_does(shape):
    wanted = policy(*shape)
    session = onnxruntime.InferenceSession(export.to_onnx(wanted), providers=["CPUExecutionProvider"])
    observation = 10 * torch.randn(500, shape[0], generator=torch.Generator().manual_seed(1))
    (action,) = session.run(["action"], {"observation": observation.numpy()})
    expected = Player([wanted])(observation).numpy()
    assert action.shape == (500, shape[1])
    np.testing.assert_allclose(action, expected, atol=1e-5)
    assert (np.abs(action) == 1).any() and (np.abs(action) < 0.9).any()


def test_the_task_s_clip_of_observations_is_in_the_file():
    wanted = policy(4, 1, (32, 32))
    seen = 10 * torch.randn(500, 4, generator=torch.Generator().manual_seed(1))
    session = onnxruntime.InferenceSession(export.deployed(wanted, registry.get("cartpole"))["policy.onnx"])
    (action,) = session.run(["action"], {"observation": seen.numpy()})
    np.testing.assert_allclose(action, Player([wanted])(seen.clamp(-5.0, 5.0)).numpy(), atol=1e-5)
    assert np.abs(action - Player([wanted])(seen).numpy()).max() > 1e-3


def test_the_file_names_its_task_and_its_sizes():
    session = onnxruntime.InferenceSession(export.to_onnx(policy(4, 1, (8,))))
    assert session.get_modelmeta().custom_metadata_map == {
        "env": "toy",
        "observation_clip": "inf",
        "observation_unseen": "",
    }
    assert [(i.name, i.shape) for i in session.get_inputs()] == [("observation", ["N", 4])]
    assert [(o.name, o.shape) for o in session.get_outputs()] == [("action", ["N", 1])]


def test_the_example_plays_the_file_on_plain_mujoco(tmp_path, monkeypatch, capsys):
    """A hand-made linear policy that balances: the force follows the pole's angle and rate."""
    # ELU is the identity above 0: so ten is added before it and subtracted after it.
    tensors = {"w0": torch.tensor([[-0.1, -0.2, 2.0, 0.5]]).T, "b0": torch.tensor([[10.0]])}
    tensors |= {"head_w": torch.tensor([[-1.0, 0.0]]), "head_b": torch.tensor([[10.0, 0.0]])}
    tensors |= {"log_std": torch.zeros(1, 1)}
    tensors |= {"observation_mean": torch.zeros(1, 4), "observation_var": torch.ones(1, 4)}
    (tmp_path / "best").mkdir()
    made = export.to_onnx(Policy("cartpole", tensors), {"observation_clip": 5.0})
    (tmp_path / "best" / "policy.onnx").write_bytes(made)
    monkeypatch.setattr("sys.argv", ["play_onnx.py", str(tmp_path)])
    runpy.run_path(str(Path(__file__).parents[2] / "examples" / "play_onnx.py"))
    assert "The pole stood for 10.0 s" in capsys.readouterr().out


def test_columns_that_the_policy_does_without_are_named():
    found = export.deployed(replace(policy(60, 8, (8,)), unseen=(0, 1, 2, 3)), registry.get("ant"))
    session = onnxruntime.InferenceSession(found["policy.onnx"])
    assert session.get_inputs()[0].shape == ["N", 56]
    said, about = session.get_modelmeta().custom_metadata_map, yaml.safe_load(found["deploy.yaml"])
    assert (said["observation_unseen"], about["observation_unseen"]) == ("0,1,2,3", [0, 1, 2, 3])
    assert float(said["observation_clip"]) == about["observation_clip"] == registry.get("ant").clip_observations


@pytest.mark.parametrize(
    ("env", "shape", "choices", "actions"),
    [
        ("gym:Pendulum-v1", (3, 1), (), {"action_low": [-2.0], "action_high": [2.0]}),
        ("gym:CartPole-v1", (4, 2), (2,), {"action_options": [2], "action_first": [0]}),
    ],
)
def test_actions_of_an_environment_from_elsewhere_are_told_as_it_takes_them(env, shape, choices, actions):
    pytest.importorskip("gymnasium")
    found = export.deployed(replace(policy(shape[0], shape[1], (8,)), choices=choices), registry.get(env))
    about = found["deploy.yaml"].decode()
    assert f"The observation is what `{env}` gives" in about and "give the task's class" not in about
    assert {name: value for name, value in yaml.safe_load(about).items() if name.startswith("action")} == actions
