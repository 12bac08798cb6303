import numpy as np
import pytest
import torch

from openeureka.report import export
from openeureka.training.policy import Player, Policy

onnxruntime = pytest.importorskip("onnxruntime", reason="checks policy.onnx; comes with the extra dev")


def policy(observations: int, actions: int, hidden: tuple[int, ...]) -> Policy:
    """Random weights, large enough that both clamps act, and statistics far from zero and one."""
    generator = torch.Generator().manual_seed(0)

    def rand(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator)

    sizes = (observations, *hidden)
    tensors = {f"w{i}": rand(a, b) / a**0.5 for i, (a, b) in enumerate(zip(sizes, hidden, strict=False))}
    tensors |= {f"b{i}": rand(1, size) for i, size in enumerate(hidden)}
    tensors |= {"head_w": rand(hidden[-1], actions + 1), "head_b": rand(1, actions + 1), "log_std": rand(1, actions)}
    tensors |= {"observation_mean": 3 * rand(1, observations), "observation_var": 0.1 + 4 * rand(1, observations) ** 2}
    return Policy("toy", tensors)


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


def test_the_file_names_its_task_and_its_sizes():
    session = onnxruntime.InferenceSession(export.to_onnx(policy(4, 1, (8,))))
    assert session.get_modelmeta().custom_metadata_map == {"env": "toy"}
    assert [(i.name, i.shape) for i in session.get_inputs()] == [("observation", ["N", 4])]
    assert [(o.name, o.shape) for o in session.get_outputs()] == [("action", ["N", 1])]
