"""A policy as an ONNX file, for robots and programs without PyTorch."""

from __future__ import annotations

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from ..training.normalize import EPSILON, LIMIT
from ..training.policy import Policy

OPSET = 17
"""Old enough for runtimes since 2022."""


def to_onnx(policy: Policy) -> bytes:
    """The deterministic policy: `observation` (N, O) float32, as the task makes it, to `action` (N, A) in [-1, 1].

    Normalisation is inside: (x - mean) / sqrt(var + 1e-5) clamped at +-5, then ELU layers and a linear head.

    Raises:
        RewardFileError: when its tensors are those of no network.
    """
    policy.expect()
    tensors = {name: value.cpu().double().numpy() for name, value in policy.tensors.items()}
    count = policy.actions
    constants = {
        "mean": tensors["observation_mean"],
        "scale": 1.0 / np.sqrt(tensors["observation_var"] + EPSILON),
        "low": np.array(-LIMIT),
        "high": np.array(LIMIT),
        "head_w": tensors["head_w"][:, :count],  # without the value
        "head_b": tensors["head_b"][:, :count],
        "lowest": np.array(-1.0),
        "highest": np.array(1.0),
    }
    nodes = [
        helper.make_node("Sub", ["observation", "mean"], ["centred"]),
        helper.make_node("Mul", ["centred", "scale"], ["scaled"]),
        helper.make_node("Clip", ["scaled", "low", "high"], ["x0"]),
    ]
    for layer in range(len(policy.hidden)):
        constants |= {name: tensors[name] for name in (f"w{layer}", f"b{layer}")}
        nodes += [
            helper.make_node("Gemm", [f"x{layer}", f"w{layer}", f"b{layer}"], [f"h{layer}"]),
            helper.make_node("Elu", [f"h{layer}"], [f"x{layer + 1}"]),
        ]
    nodes += [
        helper.make_node("Gemm", [f"x{len(policy.hidden)}", "head_w", "head_b"], ["head"]),
        helper.make_node("Clip", ["head", "lowest", "highest"], ["action"]),
    ]
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["N", policy.observations])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["N", count])],
        [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="openeureka")
    model.ir_version = 8  # the one that came with this opset
    helper.set_model_props(model, {"env": policy.env})
    onnx.checker.check_model(model)
    return model.SerializeToString()
