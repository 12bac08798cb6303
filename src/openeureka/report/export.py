"""A policy as ONNX, for those without PyTorch, and learning curves for TensorBoard: files for other programs."""

from __future__ import annotations

import math
from importlib.resources import files
from io import BytesIO

import numpy as np
import onnx
import yaml
from onnx import TensorProto, helper, numpy_helper

# The classes of these two modules are made at import time, where no type checker sees them.
from tensorboard.compat.proto.event_pb2 import Event  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.summary_pb2 import Summary  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.summary.writer.record_writer import RecordWriter

from ..codec import plain
from ..tasks.deployment import Interface, interface, of_task
from ..tasks.task import Task
from ..training.network import EPSILON, LIMIT
from ..training.policy import Policy
from ..types import TrainingResult

OPSET = 17
"""Old enough for runtimes since 2022."""
EVENTS = "events.out.tfevents.0"
"""TensorBoard recognises event files by `tfevents` in their name."""


def to_onnx(policy: Policy, robot: Interface | None = None, clip: float = math.inf) -> bytes:
    """The deterministic policy: `observation` (N, O) float32, as the task makes it, to `action` (N, A) in [-1, 1].

    O counts what the policy sees: unseen columns are left out.

    Of C choices `action` is (N, C) int64: the index of the option of each. Inside are the task's clip of observations
    and normalisation, (x - mean) / sqrt(var + 1e-5) clamped at +-5, then ELU layers and a linear head.

    Args:
        clip: at which the task clips observations, `Task.clip_observations`.
        robot: what the file's metadata say beside the task's name: text, lists with commas.

    Raises:
        RewardFileError: when its tensors are those of no network.
    """
    policy.expect()
    tensors = {name: value.cpu().double().numpy() for name, value in policy.tensors.items()}
    count = policy.actions
    seen = [column for column in range(policy.observations) if column not in policy.unseen]
    tensors |= {"w0": tensors["w0"][seen]}
    constants = {
        "mean": tensors["observation_mean"][:, seen],
        "scale": 1.0 / np.sqrt(tensors["observation_var"][:, seen] + EPSILON),
        "low": np.array(-LIMIT),
        "high": np.array(LIMIT),
        "head_w": tensors["head_w"][:, :count],  # without the value
        "head_b": tensors["head_b"][:, :count],
    }
    observed = "observation"
    if math.isfinite(clip):
        constants |= {"least": np.array(-clip), "most": np.array(clip)}
        observed = "clipped"
    nodes = [
        *([helper.make_node("Clip", ["observation", "least", "most"], [observed])] if math.isfinite(clip) else []),
        helper.make_node("Sub", [observed, "mean"], ["centred"]),
        helper.make_node("Mul", ["centred", "scale"], ["scaled"]),
        helper.make_node("Clip", ["scaled", "low", "high"], ["x0"]),
    ]
    for layer in range(len(policy.hidden)):
        constants |= {name: tensors[name] for name in (f"w{layer}", f"b{layer}")}
        nodes += [
            helper.make_node("Gemm", [f"x{layer}", f"w{layer}", f"b{layer}"], [f"h{layer}"]),
            helper.make_node("Elu", [f"h{layer}"], [f"x{layer + 1}"]),
        ]
    nodes += [helper.make_node("Gemm", [f"x{len(policy.hidden)}", "head_w", "head_b"], ["head"])]
    exact: list[onnx.TensorProto] = []
    if policy.choices:
        parts, picked = ([f"{name}{choice}" for choice in range(len(policy.choices))] for name in ("part", "picked"))
        exact = [numpy_helper.from_array(np.array(policy.choices, np.int64), "choices")]
        nodes += [
            helper.make_node("Split", ["head", "choices"], parts, axis=1),
            *(
                helper.make_node("ArgMax", [part], [index], axis=1, keepdims=1)
                for part, index in zip(parts, picked, strict=True)
            ),
            helper.make_node("Concat", picked, ["action"], axis=1),
        ]
        action = helper.make_tensor_value_info("action", TensorProto.INT64, ["N", len(policy.choices)])
    else:
        constants |= {"lowest": np.array(-1.0), "highest": np.array(1.0)}
        nodes += [helper.make_node("Clip", ["head", "lowest", "highest"], ["action"])]
        action = helper.make_tensor_value_info("action", TensorProto.FLOAT, ["N", count])
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["N", len(seen)])],
        [action],
        [*(numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()), *exact],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="openeureka")
    model.ir_version = 8  # the one that came with this opset
    helper.set_model_props(model, {"env": policy.env} | (_said(robot) if robot is not None else {}))
    onnx.checker.check_model(model)
    return model.SerializeToString()


def _said(robot: Interface) -> dict[str, str]:
    found = {name: value if isinstance(value, list | tuple) else [value] for name, value in plain(robot).items()}
    return {name: ",".join(str(value) for value in values) for name, values in found.items()}


def deployed(policy: Policy, task: type[Task]) -> dict[str, bytes]:
    """Files beside policy.onnx by name, that one included: what runs the policy without openeureka.

    Of a task that says nothing of its observation deploy.yaml says so, and is alone.
    """
    if task.deployment is None:
        return {
            "policy.onnx": to_onnx(policy, clip=task.clip_observations),
            "deploy.yaml": _NOT_SAID.format(env=task.env).encode(),
        }
    policy.expect(task.num_observations, task.num_actions)
    spec, model = task.compiled()
    robot = interface(
        task.env,
        of_task(task.deployment, task),
        model,
        control_dt=task.control_dt,
        clip=task.clip_observations,
        unseen=policy.unseen,
    )
    about = yaml.safe_dump(plain(robot), sort_keys=False, default_flow_style=None, width=110)
    return {
        "policy.onnx": to_onnx(policy, robot, task.clip_observations),
        "deploy.yaml": (_HEAD + about).encode(),
        "scene.xml": spec.to_xml().encode(),
        "sim2sim.py": files("openeureka.report").joinpath("sim2sim.py").read_bytes(),
    }


_NOT_SAID = (
    "# `{env}` does not say what its observation is made of, so no other program can make it: give the task's class a\n"
    "# `deployment` (openeureka.tasks.deployment).\nenv: {env}\n"
)
_HEAD = """# What runs policy.onnx on a robot. Lists are in the order of actions or of the observation; units are SI.
# target angle = default_joint_pos + action_scale * action; torque = joint_stiffness * (target - angle)
# - joint_damping * rate, at most torque_limit. The observation's terms, in order, times observation_scales, are
# clipped; normalisation is inside policy.onnx. sim2sim.py does all of it.
"""


def events_of(result: TrainingResult) -> bytes:
    """The event file of a training: one scalar per curve and epoch, over environment steps, or over epochs where it
    counts no steps, from time 0 on. Equal trainings give equal bytes: no host name goes in.

    Epochs that no clock tells of are taken to last equally long.
    """
    curves, first, clock = result.over_epochs, result.steps_before, result.clock
    epochs = max(map(len, curves.values()), default=0)
    buffer = BytesIO()
    writer = RecordWriter(buffer)
    writer.write(Event(file_version="brain.Event:2").SerializeToString())
    for tag, values in curves.items():
        for epoch, value in enumerate(values):
            if value is not None:
                summary = Summary(value=[Summary.Value(tag=tag, simple_value=value)])
                step = first + (epoch + 1) * (result.env_steps - first) // epochs if result.env_steps else epoch
                time = clock[epoch] if epoch < len(clock) else (epoch + 1) * result.seconds / epochs
                writer.write(Event(step=step, wall_time=time, summary=summary).SerializeToString())
    return buffer.getvalue()
